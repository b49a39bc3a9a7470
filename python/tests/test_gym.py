"""The Gymnasium environment."""

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

import sfers_rs.gym  # noqa: E402


def test_the_environment_passes_gymnasiums_check():
    from gymnasium.utils.env_checker import check_env

    environment = gymnasium.make("sfers_rs/Crawler-v0")
    with pytest.warns(UserWarning, match="normalize|symmetric|normalized|observation space (minimum|maximum)"):
        check_env(environment.unwrapped, skip_render_check=True)


def test_a_gait_by_hand_moves_the_robot_and_the_rewards_add_up_to_its_way():
    environment = gymnasium.make("sfers_rs/Crawler-v0", duration_s=1.0)
    _, start = environment.reset(seed=1)
    phases = [[0, 0, 0, 0, 0], [-1500, 0, 0, 0, 0], [-1500, -1500, -1500, -1500, 0], [0, -1500, -1500, -1500, -1500], [0, 0, 0, 0, -1500]]
    rewards, truncated, at = [], False, 0
    while not truncated:
        _, reward, terminated, truncated, info = environment.step(np.array(phases[at // 4 % 5], float))
        rewards.append(reward)
        at += 1
        assert not terminated
    assert at == 100 and abs(sum(rewards) * 0.01 - (info["x_mm"] - start["x_mm"])) < 1e-9
    assert abs(info["x_mm"] - start["x_mm"]) > 0.5


def test_seeds_decide_the_start():
    environment = sfers_rs.gym.Crawler()
    first, other, again = (environment.reset(seed=seed)[0] for seed in (1, 2, 1))
    assert np.array_equal(first, again) and not np.array_equal(first, other)


def test_wrong_arguments_are_named():
    with pytest.raises(ValueError, match="control_period_s"):
        sfers_rs.gym.Crawler(control_period_s=0.00015)
    environment = sfers_rs.gym.Crawler()
    environment.reset(seed=0)
    with pytest.raises(ValueError, match="action"):
        environment.step(np.full(5, 1e4))
