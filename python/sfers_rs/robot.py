"""Robots and drives: tables of an experiment file, made by functions with units in the names of their arguments."""

from __future__ import annotations

import difflib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _native


@cache
def _keys() -> dict[str, dict[str, Any]]:
    """The keys of an experiment file by their names with dots."""
    files = json.loads(_native.key_tables())["files"]
    return {key["key"]: key for file in files if file["file"] == "experiment" for key in file["keys"]}


def _place(name: str) -> tuple[str, ...]:
    """The tables and the key of an experiment file that a keyword argument stands for: ``friction_low`` for ``robot.friction.low``."""
    if name == "material":
        return ("material", "preset")
    friction = name.removeprefix("friction_")
    for table, key in (("robot.friction", friction), ("robot", name), ("material", name)):
        if f"{table}.{key}" in _keys() and (table != "robot.friction" or name.startswith(("friction_", "film"))):
            return (*table.split("."), key)
    tables = ("robot.friction.", "robot.", "material.")
    known = {key.removeprefix(table) for key in _keys() for table in tables if key.startswith(table) and "." not in key.removeprefix(table)}
    near = difflib.get_close_matches(name, known | {"friction_ground", "friction_low", "friction_high"}, 1)
    hint = f"; did you mean {near[0]}?" if near else "; help(sfers_rs.Robot) lists some, sfers_rs.keys() all"
    raise TypeError(f"a robot has no {name!r}{hint}")


@dataclass(frozen=True)
class Robot:
    """A robot: the tables ``[material]`` and ``[robot]`` of an experiment file.

    Make one with :meth:`cantilever`, :meth:`crawler` or :meth:`free`; each takes any key of these tables as a keyword argument, for example

    * ``actuators`` (5), ``motors_per_actuator`` (3): laminates N, and joints m in each
    * ``damping_eta`` (-): the reference's ``dampingEta``, or ``damping_time_s``: the damping time of eq. 1
    * ``friction_low``, ``friction_high``, ``friction_ground`` (-): of the bare robot, its films and the floor; ``film``, ``film_fraction``
    * ``positive_gain`` (-): factor on positive voltages
    * ``material``: ``"parameter-2"`` or ``"parameter-4"``, and any property of the layers, as ``piezo_thickness_um``, ``gravity_m_s2``

    Units stand in the names; :func:`sfers_rs.keys` lists all keys with default and range. Values are checked when the robot is simulated.

    >>> Robot.cantilever(motors_per_actuator=5, damping_eta=0.2).tables["robot"]["actuators"]
    1
    """

    tables: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def cantilever(cls, **keys: Any) -> Robot:
        """One actuator, clamped at its left end."""
        return cls._with({"actuators": 1, "mount": "clamped"}, keys)

    @classmethod
    def crawler(cls, **keys: Any) -> Robot:
        """Five actuators on the floor."""
        return cls._with({"actuators": 5, "mount": "ground"}, keys)

    @classmethod
    def free(cls, **keys: Any) -> Robot:
        """Five actuators without clamp or floor."""
        return cls._with({"actuators": 5, "mount": "free"}, keys)

    @classmethod
    def _with(cls, robot: dict[str, Any], keys: Mapping[str, Any]) -> Robot:
        tables: dict[str, Any] = {"robot": robot}
        for name, value in keys.items():
            *path, key = _place(name)
            inner = tables
            for table in path:
                inner = inner.setdefault(table, {})
            inner[key] = value
        return cls(tables)

    def replaced(self, **keys: Any) -> Robot:
        """The same robot with other values of some keys."""
        copy = json.loads(json.dumps(self.tables, default=plain))
        new = self._with({}, keys).tables
        return Robot(merged(copy, new))


def merged(base: dict[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """``base`` with the values of ``other`` put into it, table by table."""
    for key, value in other.items():
        if isinstance(value, Mapping) and isinstance(base.get(key), dict):
            merged(base[key], value)
        else:
            base[key] = value
    return base


def plain(value: Any) -> Any:
    """Numpy's numbers and arrays as Python's, for JSON."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} ({value!r}) cannot stand in an experiment; numbers, texts, lists and dicts can")


@dataclass(frozen=True)
class Drive:
    """What voltage each actuator gets, when: the table ``[drive]`` of an experiment file, or an array.

    A negative voltage bends the free end of a clamped robot down. The piezo takes -1500 V to 520 V.
    """

    table: Mapping[str, Any]
    #: Times (s), shape (T,), and voltages (V), shape (T, actuators), of a drive from arrays.
    samples: tuple[np.ndarray, np.ndarray] | None = None

    @classmethod
    def dc(cls, voltages_v: ArrayLike) -> Drive:
        """Constant voltages (V), shape (actuators,)."""
        return cls({"waveform": "dc", "voltages_v": np.atleast_1d(np.asarray(voltages_v, float))})

    @classmethod
    def step(cls, voltages_v: ArrayLike, at_s: float = 0.0) -> Drive:
        """0 V, then constant voltages (V) from ``at_s`` (s) on."""
        return cls({"waveform": "step", "voltages_v": np.atleast_1d(np.asarray(voltages_v, float)), "at_s": at_s})

    @classmethod
    def sine(cls, amplitude_v: ArrayLike, frequency_hz: float) -> Drive:
        """``V = A/2 (1 - cos 2 pi f t)`` with A (V) of every actuator, or one for each, and f (Hz)."""
        amplitudes = np.asarray(amplitude_v, float)
        key = "amplitudes_v" if amplitudes.ndim else "amplitude_v"
        return cls({"waveform": "sine", key: amplitudes, "frequency_hz": frequency_hz})

    @classmethod
    def gait(cls, name: str, **keys: Any) -> Drive:
        """A gait of five actuators by its name, as ``"full-frictional-inchworm"``, with ``frequency_hz`` or ``period_s`` (or ``delay_s``, ``on_time_s``), and ``on_voltages_v`` (V)."""
        return cls({"waveform": "gait", "gait": name, **keys})

    @classmethod
    def sampled(cls, times_s: ArrayLike, voltages_v: ArrayLike) -> Drive:
        """Voltages (V), shape (T, actuators), or (T,) of one actuator, at rising times (s), shape (T,); linear between, held at the ends."""
        times, voltages = np.ascontiguousarray(times_s, float), np.ascontiguousarray(voltages_v, float)
        if voltages.ndim == 1:
            voltages = voltages[:, None]
        if times.ndim != 1 or voltages.ndim != 2 or len(times) != len(voltages):
            raise ValueError(f"times_s has the shape {times.shape} and voltages_v {np.shape(voltages_v)}; needed are (T,) and (T, actuators)")
        # The table only stands for the number of actuators; the samples replace it.
        return cls({"waveform": "dc", "voltages_v": np.zeros(voltages.shape[1])}, (times, voltages))


#: What a simulation takes for a drive: a :class:`Drive`, its table, an array of constant voltages (V), or a function of the simulation that returns voltages.
DriveLike = Drive | Mapping[str, Any] | Sequence[float] | np.ndarray | Callable[[Any], ArrayLike]
