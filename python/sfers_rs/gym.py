"""A Gymnasium environment: ``gymnasium.make("sfers_rs/Crawler-v0")``. Importing this module, or gymnasium where this package is installed, registers it."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from .robot import Robot
from .simulation import Simulation

#: What the piezo takes (V).
LOWEST_V, HIGHEST_V = -1500.0, 520.0


class Crawler(gymnasium.Env):
    """A robot on the floor: voltages in, markers out, reward its speed.

    * Action: the voltage of each actuator (V), shape (actuators,), from -1500 to 520, held for one control period.
    * Observation: of every node (left end, joints, right end) x from the nodes' mean (mm), z (mm), and its velocity along x and z (mm/s): shape (4, joints + 2).
    * Reward: the speed of the nodes' mean x over the control period (mm/s).
    * ``info``: ``time_s``, ``x_mm`` (the nodes' mean).

    An episode is truncated after ``duration_s``. At its start the joints have small random angles, from the seed.

    Args:
        robot: the robot, by default ``Robot.crawler(friction_low=1.2, friction_high=4.0, film="both-ends")``.
        control_period_s: time between actions (s), a multiple of the time step.
        duration_s: length of an episode (s).
        time_step_s, engine: as of :class:`sfers_rs.Simulation`.
        start_angle_rad: standard deviation of the joints' angles at the start (rad).
    """

    metadata = {"render_modes": []}

    def __init__(
        self,
        robot: Robot | None = None,
        *,
        control_period_s: float = 0.01,
        duration_s: float = 2.0,
        time_step_s: float = 1e-4,
        engine: str = "planar",
        start_angle_rad: float = 1e-4,
    ):
        self._robot = robot or Robot.crawler(friction_low=1.2, friction_high=4.0, film="both-ends", damping_eta=0.03)
        self._options: dict[str, Any] = {"engine": engine, "time_step_s": time_step_s}
        self._steps = round(control_period_s / time_step_s)
        if not (self._steps >= 1 and abs(self._steps * time_step_s - control_period_s) < 1e-6 * control_period_s):
            raise ValueError(f"control_period_s: {control_period_s} is no multiple of the time step, {time_step_s} s")
        self._period, self._duration, self._start_angle = control_period_s, duration_s, start_angle_rad
        self._simulation = Simulation(self._robot, **self._options)
        nodes = len(self._simulation.nodes)
        self._joints = nodes - 2
        actuators = int(self._robot.tables["robot"].get("actuators", 5))
        self.action_space = gymnasium.spaces.Box(LOWEST_V, HIGHEST_V, (actuators,), np.float64)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (4, nodes), np.float64)

    def _observe(self) -> tuple[np.ndarray, float]:
        """The observation and the nodes' mean x (mm)."""
        nodes = 10.0 * self._simulation.nodes.T
        mean = float(nodes[0].mean())
        return np.vstack([nodes[0] - mean, nodes[1], 10.0 * self._simulation.node_velocities.T]), mean

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Puts the robot back, with new random angles."""
        super().reset(seed=seed)
        angles = self._start_angle * self.np_random.standard_normal(self._joints)
        self._simulation = Simulation(self._robot, joint_angles_rad=angles, **self._options)
        observation, self._x = self._observe()
        return observation, {"time_s": 0.0, "x_mm": self._x}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Holds the voltages (V) for a control period."""
        if not self.action_space.contains(np.asarray(action, np.float64)):
            raise ValueError(f"action: {action} does not lie in {self.action_space}")
        self._simulation.step(self._steps, action)
        observation, x = self._observe()
        speed = (x - self._x) / self._period
        self._x = x
        time = self._simulation.time_s
        return observation, speed, False, time > self._duration - 0.5 * self._period, {"time_s": time, "x_mm": x}


def register() -> None:
    """Registers the environment; gymnasium calls it by the package's entry point."""
    if "sfers_rs/Crawler-v0" not in gymnasium.registry:
        gymnasium.register("sfers_rs/Crawler-v0", "sfers_rs.gym:Crawler")


register()
