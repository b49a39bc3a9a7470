"""A robot that a program steps: closed loops, one step or many at a time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _native
from .experiment import ExperimentLike, native
from .robot import Drive, DriveLike, Robot

#: What :attr:`Simulation.contacts` has for each contact.
CONTACT = np.dtype([("link", int), ("position_cm", float, 2), ("force_dyn", float, 2)])


class State:
    """A saved state of a :class:`Simulation`; it can be pickled, and restored in any simulation of the same robot, engine and time step."""

    def __init__(self, text: str):
        self._text = text

    def __eq__(self, other: object) -> bool:
        return isinstance(other, State) and self._text == other._text

    def __hash__(self) -> int:
        return hash(self._text)


class Simulation:
    """A robot with its drive, between two time steps.

    The same robot, drive, engine and time step give the bits of :func:`sfers_rs.run`.

    Args:
        robot: a :class:`Robot`, or anything that :func:`sfers_rs.run` takes; of an experiment its own drive and settings count.
        drive: of a robot: a :class:`Drive`, its table, constant voltages (V), or a function that gets this simulation before every step and returns the voltages (V), shape
            (actuators,). 0 V if it is not given, to be driven by :meth:`step`.
        engine: ``"planar"`` (the fast one) or ``"bullet"`` (bit for bit the published simulator).
        time_step_s: the time step (s).
        effects: extensions of the model, as ``[{"id": "hysteresis", ...}]``.
        simulation: other keys of ``[simulation]``, as ``start="settled"``.

    A simulation belongs to one thread at a time: another one gets a RuntimeError. It can be copied and pickled unless a function drives it.

    >>> import sfers_rs as sf
    >>> simulation = sf.Simulation(sf.Robot.cantilever(damping_eta=0.2), sf.Drive.dc(-1000), time_step_s=1e-4)
    >>> simulation.step(5000)
    >>> bool(-30 < 10 * simulation.nodes[-1, 1] < -15)  # mm
    True
    """

    def __init__(
        self,
        robot: ExperimentLike,
        drive: DriveLike | None = None,
        *,
        engine: str | None = None,
        time_step_s: float | None = None,
        effects: list[Mapping[str, Any]] | None = None,
        set: Mapping[str, Any] | None = None,
        **simulation: Any,
    ):
        function = drive if callable(drive) and not isinstance(drive, Drive) else None
        if isinstance(robot, Robot):
            engine, time_step_s = engine or "planar", time_step_s or 1e-4
            simulation.setdefault("steps", 1)
            if function is not None or drive is None:
                drive = Drive.dc(np.zeros(int(robot.tables["robot"].get("actuators", 5))))
        elif function is not None:
            drive = None
        keys = simulation | {"engine": engine, "time_step_s": time_step_s}
        self._experiment = native(robot, drive, settings=set, effects=effects, simulation=keys)
        self._function = function
        self._native = self._experiment.simulation()
        # What makes the same simulation again.
        self._arguments = (robot, drive, effects, set, keys)

    def step(self, n: int = 1, voltages: ArrayLike | None = None) -> None:
        """Takes ``n`` steps; Ctrl-C is heard between chunks of them.

        Args:
            n: number of steps, 0 or more.
            voltages: (V) of shape (actuators,): held in these steps and all later ones; of shape (n, actuators): a row for each step. Without them the drive
                gives the voltages, or what was given before. They replace the drive's without its gain and delay; :meth:`follow_drive` gives it the lead again.

        Raises:
            ValueError: for a negative ``n``, voltages of another shape, or more than the material bears.
            SimulationError: if the simulation goes wrong.
        """
        if voltages is not None or self._function is None:
            return self._native.step(n, voltages)
        for _ in range(n):
            given = np.atleast_1d(np.asarray(self._function(self), float))
            if given.shape != (self._experiment.actuators,):
                needed = (self._experiment.actuators,)
                raise ValueError(f"drive: the function returned the shape {given.shape}, but the robot needs {needed}")
            self._native.step(1, given)
        return None

    def follow_drive(self) -> None:
        """Gives the actuators the drive's voltages again."""
        self._native.follow_drive()

    def run_until(self, time_s: float) -> None:
        """Steps to the multiple of the time step that is nearest to ``time_s`` (s)."""
        steps = round(time_s / self.time_step_s) - self.steps
        if steps < 0:
            raise ValueError(f"time_s: cannot run until {time_s} s from {self.time_s} s on")
        self.step(steps)

    @property
    def time_step_s(self) -> float:
        """The time step (s)."""
        return self._experiment.time_step_s

    @property
    def time_s(self) -> float:
        """Time (s): the number of steps times the time step."""
        return self._native.time_s

    @property
    def steps(self) -> int:
        """Number of steps taken."""
        return self._native.steps

    @property
    def joint_angles(self) -> np.ndarray:
        """Angles of the joints (rad), shape (joints,), from the left; a positive one lowers the far end."""
        return self._native.joint_angles

    @property
    def joint_rates(self) -> np.ndarray:
        """Rates of the joints (rad/s), shape (joints,)."""
        return self._native.joint_rates

    @property
    def joint_torques(self) -> np.ndarray:
        """Torques of the joints in the coming step (dyn cm), shape (joints,)."""
        return self._native.joint_torques

    @property
    def joint_voltages(self) -> np.ndarray:
        """Voltages of the joints in the coming step (V), their actuator's divided by m, shape (joints,)."""
        return self._native.joint_voltages

    @property
    def nodes(self) -> np.ndarray:
        """x and z (cm) of left end, joints and right end, shape (joints + 2, 2). On Bullet the joints' lag one step behind, as the published simulator records them."""
        return self._native.nodes

    @property
    def node_velocities(self) -> np.ndarray:
        """Velocities of the nodes along x and z (cm/s), shape (joints + 2, 2)."""
        return self._native.node_velocities

    @property
    def contacts(self) -> np.ndarray:
        """Forces of the floor on the robot, means over the last step: a structured array (:data:`CONTACT`) of link (0 at the left end), position (cm) and force (dyn) along x and z."""
        rows = self._native.contacts
        found = np.empty(len(rows), CONTACT)
        found["link"], found["position_cm"], found["force_dyn"] = rows[:, 0], rows[:, 1:3], rows[:, 3:]
        return found

    def save(self) -> State:
        """The state. Voltages that were given to :meth:`step` are not part of it."""
        return State(self._native.save())

    def restore(self, state: State) -> None:
        """Goes on from a state of the same robot, engine and time step.

        Raises:
            ValueError: that says in what the robots differ; nothing is changed then.
        """
        if not isinstance(state, State):
            raise TypeError(f"state: a {type(state).__name__}, but restore takes what save returned")
        self._native.restore(state._text)

    def __reduce__(self) -> tuple:
        if self._function is not None:
            raise TypeError("a simulation that a function drives cannot be copied or pickled: what the function remembers is not known")
        return _restored, (*self._arguments, self.save())


def _restored(
    robot: ExperimentLike,
    drive: DriveLike | None,
    effects: list[Mapping[str, Any]] | None,
    settings: Mapping[str, Any] | None,
    keys: dict[str, Any],
    state: State,
) -> Simulation:
    simulation = Simulation(robot, drive, effects=effects, set=settings, **keys)
    simulation.restore(state)
    return simulation


#: A function that drives a simulation.
DriveFunction = Callable[[Simulation], ArrayLike]
