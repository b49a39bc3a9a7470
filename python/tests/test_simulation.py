"""Stepped simulations: the bits of a run, closed loops, states, threads and processes."""

import copy
import multiprocessing
import pickle
import threading

import numpy as np
import pytest

import sfers_rs as sf

ROBOT = sf.Robot.crawler(friction_low=1.2, friction_high=4.0, film="both-ends", damping_eta=0.03)
GAIT = sf.Drive.gait("full-frictional-inchworm", frequency_hz=10)
ENGINES = [("planar", 1e-4), ("bullet", 1e-5)]


def simulation(engine="planar", step=1e-4, drive=GAIT) -> sf.Simulation:
    return sf.Simulation(ROBOT, drive, engine=engine, time_step_s=step)


@pytest.mark.parametrize(("engine", "step"), ENGINES)
def test_steps_have_the_bits_of_a_run(engine, step):
    recording = sf.run(ROBOT, GAIT, engine=engine, time_step_s=step, steps=400, record_every_steps=1)
    stepped = simulation(engine, step)
    for record in (0, 1, 2, 57, 399):
        stepped.run_until(recording.time_s[record])
        assert np.array_equal(stepped.joint_angles, recording["dataTheta"][record])
        assert np.array_equal(stepped.joint_rates, recording["dataAngularVelocities"][record])
        assert np.array_equal(stepped.nodes, recording["dataPositions"][record][:, ::2])
    assert stepped.steps == 399 and stepped.time_s == pytest.approx(399 * step)


@pytest.mark.parametrize(("engine", "step"), ENGINES)
def test_a_saved_state_goes_on_with_the_same_bits_and_so_do_copies_and_pickles(engine, step):
    first = simulation(engine, step)
    first.step(150)
    state, copies = first.save(), [copy.deepcopy(first), pickle.loads(pickle.dumps(first))]
    other = simulation(engine, step)
    other.restore(pickle.loads(pickle.dumps(state)))
    for each in (first, other, *copies):
        each.step(150)
        assert np.array_equal(each.joint_angles, first.joint_angles) and each.steps == 300
    with pytest.raises(ValueError, match="another"):
        sf.Simulation(ROBOT.replaced(damping_eta=0.05), engine=engine, time_step_s=step).restore(state)


def test_rows_of_voltages_single_steps_and_a_function_are_the_same():
    rows = 200 * np.sin(np.arange(300)[:, None] / 20 + np.arange(5))
    by_rows, by_steps = simulation(drive=None), simulation(drive=None)
    by_function = simulation(drive=lambda s: rows[s.steps])
    by_rows.step(300, rows)
    for row in rows:
        by_steps.step(1, list(row))
    by_function.step(300)
    assert np.array_equal(by_rows.joint_angles, by_steps.joint_angles)
    assert np.array_equal(by_rows.joint_angles, by_function.joint_angles)


def test_a_rate_feedback_damps():
    """Voltages against the rate of the joints take energy out of a bent robot."""

    def ringing(gain):
        robot = sf.Robot.cantilever(damping_eta=0.005)
        stepped = sf.Simulation(robot, lambda s: np.clip(-gain * s.joint_rates.mean(), -500, 500), time_step_s=1e-4, joint_angles_rad=[0.05] * 3)
        stepped.step(4000)
        heights = []
        for _ in range(1000):
            stepped.step()
            heights.append(stepped.nodes[-1, 1])
        return np.ptp(heights)

    assert ringing(-100) < 0.3 * ringing(0)


def test_contacts_carry_the_weight():
    stepped = sf.Simulation(ROBOT, time_step_s=1e-4)
    stepped.step(2000)
    contacts = stepped.contacts
    resolved = sf.resolved(ROBOT, [0] * 5, steps=1, engine="planar", time_step_s=1e-4)
    material = resolved["material"]
    layers = [("substrate", "substrate"), ("piezo", "piezo"), ("adhesive", "adhesive")]
    areal = sum(material[f"{a}_density"] * material[f"{b}_thickness"] for a, b in layers)
    weight = 5 * areal * material["width"] * material["actuator_length"] * material["gravity"]
    assert contacts["force_dyn"][:, 1].sum() == pytest.approx(weight, rel=1e-3)
    assert contacts["link"].min() == 0 and contacts["link"].max() == 15


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: s.step(-1), ["n", "-1"]),
        (lambda s: s.step(2, np.zeros((3, 5))), ["voltages", "[3, 5]", "(5,)"]),
        (lambda s: s.step(1, np.zeros(4)), ["voltages", "[4]"]),
        (lambda s: s.step(1, [np.nan] * 5), ["voltage 1"]),
        (lambda s: s.step(1, [1e9] * 5), ["voltage 1"]),
        (lambda s: s.step(1, "abc"), ["voltages"]),
        (lambda s: s.step(1, [[1], [2, 3]]), ["voltages"]),
        (lambda s: s.run_until(-1), ["time_s"]),
        (lambda s: s.restore("state"), ["state"]),
    ],
)
def test_wrong_arguments_are_named(call, words):
    stepped = simulation()
    with pytest.raises((ValueError, TypeError)) as caught:
        call(stepped)
    assert all(word in str(caught.value) for word in words), caught.value
    stepped.step(10)


@pytest.mark.parametrize("nonsense", [lambda s: [1, 2], lambda s: None, lambda s: "on", lambda s: [np.inf] * 5])
def test_a_drive_that_returns_nonsense_is_refused(nonsense):
    with pytest.raises((ValueError, TypeError)):
        simulation(drive=nonsense).step(3)


def test_an_exception_in_a_drive_comes_out():
    def drive(s):
        raise LookupError("no voltage today")

    with pytest.raises(LookupError, match="no voltage today"):
        simulation(drive=drive).step(3)


def test_a_second_thread_is_told_and_the_interpreter_is_free_meanwhile():
    stepped, seen = simulation(), []
    worker = threading.Thread(target=lambda: stepped.step(300_000))
    worker.start()
    while worker.is_alive() and not seen:
        try:
            stepped.step(1)
        except RuntimeError as error:
            seen.append(str(error))
    worker.join()
    assert seen and "another thread" in seen[0]
    stepped.step(1)


def _angles(seed: int) -> np.ndarray:
    stepped = simulation()
    stepped.step(100 + seed)
    return stepped.joint_angles


def test_forked_workers_have_the_same_bits():
    sf.sweep({"experiment": "crawl", "measures": ["speed_mm_s"], "vary": {"simulation.duration_s": [0.01]}}, progress=False)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        results = pool.map_async(_angles, range(6)).get(timeout=60)
    assert all(np.array_equal(result, _angles(seed)) for seed, result in enumerate(results))
