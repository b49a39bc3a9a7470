"""Sweeps: an experiment over a grid of values."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _native
from .experiment import _json, _settings
from .recording import read_csv

if TYPE_CHECKING:
    import pandas


def _bar(done: int, points: int) -> None:
    """A line on standard error that counts the points."""
    end = "\n" if done == points else ""
    print(f"\r{done} of {points} points", end=end, file=sys.stderr, flush=True)


def sweep(
    file: str | os.PathLike | Mapping[str, Any],
    *,
    out: str | os.PathLike | None = None,
    jobs: int | None = None,
    set: Mapping[str, Any] | None = None,
    progress: bool | Callable[[int, int], None] | None = None,
) -> pandas.DataFrame:
    """Runs an experiment over a grid of values, in parallel.

    Args:
        file: a sweep file, ``"preset:NAME"``, or its tables: ``{"experiment": ..., "measures": [...], "vary": {key: values}}``, in which ``experiment`` is a file, a preset or
            tables, and values are a list, an array, or ``{"from": a, "to": b, "count": n}``.
        out: a folder for ``results.csv``, which a sweep that was stopped goes on from; without one nothing is kept.
        jobs: runs at a time; one per processor if not given. Results do not depend on it.
        set: keys of the experiment with dots, and their values.
        progress: True or False for a line that counts, or a function of the numbers of finished and of all points; by default True on a terminal.

    Returns:
        A table with a row for each point: a column for each varied key, for each measure, and ``status``: ``ok`` or why there are no measures.

    Raises:
        ExperimentError: with ``file``, ``line`` and ``key``, if the sweep or one of its points is not valid.
        DataError: if the folder holds another sweep, or cannot be written.
    """
    if progress is None:
        progress = sys.stderr.isatty()
    told = progress if callable(progress) else (_bar if progress else None)
    if jobs is not None and not 1 <= jobs <= 1024:
        raise ValueError(f"jobs: {jobs} is not between 1 and 1024")
    jobs = jobs or len(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch if out is None else out)
        if isinstance(file, Mapping):
            folder.mkdir(parents=True, exist_ok=True)
            if set:
                raise TypeError("set belongs to a file or a preset; put the values into the tables")
            results, *_ = _native.run_sweep(None, _tables(file, folder), folder, [], jobs, told)
        else:
            settings = [f"{key}={value}" for key, value in _settings(set)]
            results, *_ = _native.run_sweep(Path(file), None, folder, settings, jobs, told)
        return read_csv(results)


def _tables(tables: Mapping[str, Any], folder: Path) -> str:
    """The sweep as JSON, with its experiment as a file in ``folder`` if it is given as tables."""
    experiment = tables.get("experiment")
    if isinstance(experiment, Mapping):
        text = _native.toml(_json(experiment))
        path = folder / "experiment.toml"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
        tables = {**tables, "experiment": path.name}
    elif isinstance(experiment, str | os.PathLike) and not str(experiment).startswith("preset:"):
        path = Path(experiment)
        # As for run: a preset's name counts where there is no such file.
        known = not path.exists() and _native.preset(str(experiment)) is not None
        tables = {**tables, "experiment": f"preset:{experiment}" if known else str(path.resolve())}
    return _json(tables)
