"""Experiments: what is simulated, from files, presets, tables, or a robot with its drive."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from . import _native
from .recording import Recording
from .robot import Drive, DriveLike, Robot, merged, plain

#: What can be run: a file, ``preset:NAME`` or ``NAME`` of a built-in one, tables as in a file, or a robot with a drive beside it.
ExperimentLike = str | os.PathLike | Mapping[str, Any] | Robot


def _json(tables: Any) -> str:
    try:
        return json.dumps(tables, default=plain, allow_nan=False)
    except ValueError as error:
        raise ValueError(f"the experiment holds a number that is not finite: {error}") from None


def _settings(settings: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    """Keys with dots and their values, in TOML: JSON's numbers, texts and lists are TOML too."""
    return [(key, value if isinstance(value, str) else _json(value)) for key, value in (settings or {}).items()]


def as_drive(drive: DriveLike) -> Drive:
    """A drive from what stands for one."""
    if isinstance(drive, Drive):
        return drive
    if isinstance(drive, Mapping):
        return Drive(drive)
    return Drive.dc(np.asarray(drive, float))


def native(
    experiment: ExperimentLike,
    drive: DriveLike | None = None,
    *,
    settings: Mapping[str, Any] | None = None,
    effects: list[Mapping[str, Any]] | None = None,
    simulation: Mapping[str, Any] | None = None,
) -> _native.Experiment:
    """The checked experiment. ``simulation`` holds keys of ``[simulation]``; the rest is explained at :func:`run`."""
    given = {key: value for key, value in (simulation or {}).items() if value is not None}
    samples = None
    if isinstance(experiment, Robot):
        if drive is None:
            raise TypeError("a robot needs a drive beside it: run(robot, drive, duration_s=...)")
        drive = as_drive(drive)
        samples = drive.samples
        tables = {**experiment.tables, "drive": drive.table, "simulation": given}
        if effects:
            tables["effect"] = list(effects)
        found = _native.Experiment.from_json(_json(tables), _settings(settings), "")
    else:
        if drive is not None or effects:
            raise TypeError("drive and effects belong to a Robot; put them into the tables, or use set={...} to change keys")
        changed = {f"simulation.{key}": value for key, value in given.items()} | dict(settings or {})
        if isinstance(experiment, Mapping):
            tables = merged({}, experiment)
            folder = os.getcwd()
            found = _native.Experiment.from_json(_json(tables), _settings(changed), folder)
        else:
            found = _native.Experiment.open(os.fspath(experiment), _settings(changed))
    return found if samples is None else found.driven_by(*samples)


def run(
    experiment: ExperimentLike,
    drive: DriveLike | None = None,
    *,
    engine: str | None = None,
    time_step_s: float | str | None = None,
    duration_s: float | None = None,
    record_every_s: float | None = None,
    effects: list[Mapping[str, Any]] | None = None,
    set: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
    **simulation: Any,
) -> Recording:
    """Simulates an experiment to its end.

    Args:
        experiment: a file, ``"preset:NAME"`` or the name of a built-in experiment, tables as in a file (a dict), or a :class:`Robot` with its ``drive``.
        drive: of a robot: a :class:`Drive`, its table, or constant voltages (V).
        engine: ``"bullet"`` (bit for bit the published simulator) or ``"planar"`` (the fast one).
        time_step_s: the time step (s), or ``"auto"`` on the planar engine.
        duration_s: simulated time (s).
        record_every_s: time between records (s); every step if neither this nor ``record_every_steps`` is given.
        effects: of a robot: extensions of the model, as ``[{"id": "hysteresis", ...}]``.
        set: other keys with dots and their values, as ``{"robot.damping_eta": 0.03}``.
        progress: called with the numbers of steps done and of all steps.
        simulation: other keys of ``[simulation]``, as ``steps``.

    Returns:
        The :class:`Recording`.

    Raises:
        ExperimentError: with ``file``, ``line`` and ``key``, if the experiment cannot be run as it is written.
        SimulationError: if the simulation goes wrong.

    >>> import sfers_rs as sf
    >>> sf.run(sf.Robot.cantilever(damping_eta=0.2), sf.Drive.dc(-1000), engine="planar", time_step_s=1e-4, duration_s=0.5).measures["tip_deflection_mm"] < -15
    True
    """
    simulation |= {"engine": engine, "time_step_s": time_step_s, "duration_s": duration_s, "record_every_s": record_every_s}
    found = native(experiment, drive, settings=set, effects=effects, simulation=simulation)
    return Recording(found.run(progress))


def resolved(experiment: ExperimentLike, drive: DriveLike | None = None, **keys: Any) -> dict[str, Any]:
    """All numbers of an experiment, in CGS units, without running it; the arguments are those of :func:`run`."""
    settings, effects = keys.pop("set", None), keys.pop("effects", None)
    return json.loads(native(experiment, drive, settings=settings, effects=effects, simulation=keys).resolved())


def urdf(experiment: ExperimentLike, path: str | os.PathLike | None = None, *, set: Mapping[str, Any] | None = None) -> str:
    """The robot as URDF, also written to ``path`` if given, with what URDF cannot say beside it in ``path`` + ``.json``."""
    found = _exported(experiment, set)
    text = found.urdf("sfers_rs.urdf")
    if path is not None:
        Path(path).write_text(text, encoding="utf-8")
        Path(f"{os.fspath(path)}.json").write_text(found.urdf_sidecar("sfers_rs.urdf"), encoding="utf-8")
    return text


def mjcf(experiment: ExperimentLike, path: str | os.PathLike | None = None, *, set: Mapping[str, Any] | None = None) -> str:
    """The robot as MJCF for MuJoCo, also written to ``path`` if given."""
    text = _exported(experiment, set).mjcf("sfers_rs.mjcf")
    if path is not None:
        Path(path).write_text(text, encoding="utf-8")
    return text


def _exported(experiment: ExperimentLike, settings: Mapping[str, Any] | None) -> _native.Experiment:
    if not isinstance(experiment, Robot):
        return native(experiment, settings=settings)
    # Neither file holds a drive.
    off = Drive.dc(np.zeros(int(experiment.tables["robot"].get("actuators", 5))))
    return native(experiment, off, settings=settings, simulation={"steps": 1, "time_step_s": 1e-5, "engine": "planar"})


def presets() -> dict[str, str]:
    """Names of the built-in experiments, sweeps and data sets, with what each is."""
    return {name: summary for _, name, summary in _native.presets()}


def preset(name: str) -> str:
    """The file (TOML) of a built-in experiment, sweep or data set, or of a class of the reference."""
    text = _native.preset(name)
    if text is None:
        raise KeyError(f"there is no preset {name!r}; presets() lists them")
    return text


def keys() -> list[dict[str, Any]]:
    """Every key of experiment, sweep and dataset files with unit, default, range and meaning, a dict each."""
    files = json.loads(_native.key_tables())["files"]
    return [{"file": file["file"], **key} for file in files for key in file["keys"]]


def effects() -> dict[str, str]:
    """Identifiers of the extensions of the model, with cause and equation."""
    return {id: f"{cause}: {equation}" for id, cause, equation in _native.effect_table()}
