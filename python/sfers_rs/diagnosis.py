"""Diagnosis of model error from measured data: of this project's robots, and of any plant that can be simulated in Python."""

from __future__ import annotations

import html
import io
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _native
from ._described import Described
from ._workers import Workers
from .plant import Plant

if TYPE_CHECKING:
    import pandas

#: Height of a report in a notebook (px).
_HEIGHT = 700


@dataclass(frozen=True)
class Estimate:
    """A fitted number: its value and its 95 % range in ``unit``; an end of the range is None where it is open."""

    name: str
    value: float
    unit: str
    low: float | None
    high: float | None
    at_bound: bool


@dataclass(frozen=True)
class Effect:
    """A cause of model error that was adopted.

    Attributes:
        id: its name.
        role: "cause", or "minor" for a rest that every bench leaves.
        kind, place: what it is, and the part of the model where it acts.
        cause: in a sentence.
        parameters: by name.
        tied_with: ids of causes that the data cannot tell from it.
        share: of the misfit of the re-tuned nominal model that comes back without it (0 to 1).
        gain_heldout: share of the misfit above the noise that it removes from runs that neither fit nor selection saw (0 to 1).
        stability: share of resamples over runs in which it is chosen (0 to 1), or None with few runs.
        curve: of a cause that was located by a free form, its curve ``{x_name, x_unit, y_name, y_unit, x, y, ci95}``, or None.
    """

    id: str
    role: str
    kind: str
    place: str
    cause: str
    parameters: dict[str, Estimate]
    tied_with: list[str]
    share: float
    gain_heldout: float
    stability: float | None
    curve: dict[str, Any] | None

    @classmethod
    def _of(cls, effect: Mapping[str, Any]) -> Effect:
        def estimate(p: Mapping[str, Any]) -> Estimate:
            low, high = p["ci95"]
            return Estimate(p["name"], p["value"], p["unit"], low, high, p["at_bound"])

        parameters = {p["name"]: estimate(p) for p in effect["parameters"]}
        return cls(**{name: effect[name] for name in cls.__dataclass_fields__ if name != "parameters"}, parameters=parameters)


@dataclass(frozen=True, repr=False)
class _Found:
    """What :class:`Diagnosis` and :class:`Identification` share."""

    #: The whole result, as in its file.
    json: dict[str, Any]
    #: The other files that :meth:`save` writes: name and text.
    files: dict[str, str] = field(default_factory=dict)

    _file = ""

    @property
    def dataset(self) -> str:
        """Name of the data set or the plant."""
        return self.json["dataset"]

    @property
    def summary(self) -> str:
        """The result in sentences."""
        return self.json["summary"]

    @property
    def remarks(self) -> list[str]:
        """Remarks on the analysis."""
        return self.json["remarks"]

    @property
    def report(self) -> str:
        """The report, a self-contained HTML page."""
        return self.files["report.html"]

    def save(self, folder: str | os.PathLike) -> Path:
        """Writes the files that ``sfers diagnose`` writes to a folder, which is made if need be, and returns it."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        # The result last: where it is, the others are complete.
        for name, text in (self.files | {self._file: json.dumps(self.json, indent=2, ensure_ascii=False) + "\n"}).items():
            unfinished = folder / f".{name}.{os.getpid()}"
            unfinished.write_text(text, encoding="utf-8", newline="")
            unfinished.replace(folder / name)
        return folder

    def _repr_html_(self) -> str:
        style = f"width:100%;height:{_HEIGHT}px;border:1px solid #ccc"
        return f'<iframe srcdoc="{html.escape(self.report)}" style="{style}"></iframe>'


@dataclass(frozen=True, repr=False)
class Diagnosis(_Found):
    """What the simulation lacks: the content of diagnosis.json with its files.

    Lengths in ``json`` whose names end in ``_mm`` are in the plant's unit.
    """

    #: The unit of the signals.
    unit: str = "mm"

    _file = "diagnosis.json"

    @property
    def verdict(self) -> str:
        """"none" (nothing is missing), "named", "located" (a place, but no law), "tied" (causes that these data cannot tell apart) or "unexplained"."""
        return self.json["verdict"]

    @property
    def effects(self) -> list[Effect]:
        """The adopted causes, with parameters and ranges."""
        return [Effect._of(effect) for effect in self.json["effects"]]

    @property
    def causes(self) -> list[str]:
        """Ids of the adopted causes without minor ones."""
        return [effect.id for effect in self.effects if effect.role == "cause"]

    @property
    def unexplained_fraction(self) -> float:
        """Share of the re-tuned nominal model's misfit above the noise that is left (0 to 1)."""
        return self.json["unexplained_fraction"]

    @property
    def heldout_errors(self) -> dict[str, float]:
        """Root mean square residuals (unit of the signals) on runs that neither fit nor selection saw: of the nominal model, with re-tuned constants, extended."""
        names = {"nominal": "baseline", "retuned": "calibrated", "extended": "extended"}
        return {name: self.json[key]["rmse_heldout_mm"] for name, key in names.items()}

    @property
    def next_experiment(self) -> str | None:
        """What to measure next, where causes are tied or data insufficient."""
        return self.json["next_experiment"]

    def to_pandas(self) -> pandas.DataFrame:
        """A row for each parameter of the effects. Needs pandas."""
        import pandas

        columns = ["effect", "role", "parameter", "value", "low", "high", "unit", "at_bound", "share", "gain_heldout", "tied_with"]
        rows = [
            (e.id, e.role, p.name, p.value, p.low, p.high, p.unit, p.at_bound, e.share, e.gain_heldout, ", ".join(e.tied_with))
            for e in self.effects
            for p in e.parameters.values()
        ]
        return pandas.DataFrame(rows, columns=columns)

    def residuals(self) -> pandas.DataFrame:
        """A row for each measured value: run, role, channel, time (s), what was measured and what the nominal, the re-tuned (``calibrated``) and the extended
        model make of it, and whether it counted (``used``). Columns of robots end in ``_mm``. Needs pandas; empty for single numbers."""
        import pandas

        text = self.files.get("residuals.csv")
        return pandas.DataFrame() if text is None else pandas.read_csv(io.StringIO(text))

    def __repr__(self) -> str:
        return f"<Diagnosis of {self.dataset}: {self.verdict}. {self.summary}>"


@dataclass(frozen=True, repr=False)
class Identification(_Found):
    """Constants from single measured numbers: the content of identification.json with its files."""

    _file = "identification.json"

    @property
    def constants(self) -> dict[str, dict[str, Any]]:
        """The constants with ranges, by key: ``value``, ``range95`` (or None), ``at_bound``, ``tied_with``."""
        return {constant["key"]: constant for constant in self.json["constants"]}

    @property
    def listed(self) -> dict[str, dict[str, Any]]:
        """The constants that have one of some values, by key: ``value`` and all ``possible`` ones."""
        return {constant["key"]: constant for constant in self.json["listed"]}

    @property
    def confirmed(self) -> dict[str, float]:
        """The constants that were simulated as an ensemble and come closest, by key."""
        return dict(self.json["confirmed"])

    @property
    def facts(self) -> list[dict[str, Any]]:
        """The measured numbers and what the constants make of them."""
        return self.json["facts"]

    @property
    def meets_all(self) -> bool:
        """True if the confirmed constants meet every number, to the noise."""
        return self.json["meets_all"]

    @property
    def experiment(self) -> str:
        """An experiment file (TOML) with the best constants."""
        return self.files["identified.toml"]

    def to_pandas(self) -> pandas.DataFrame:
        """A row for each constant with a range. Needs pandas."""
        import pandas

        rows = [(c["key"], c["value"], *(c["range95"] or (None, None)), *c["at_bound"]) for c in self.json["constants"]]
        return pandas.DataFrame(rows, columns=["constant", "value", "low", "high", "low_at_bound", "high_at_bound"])

    def __repr__(self) -> str:
        return f"<Identification of {self.dataset}: {self.summary}>"


def _processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def diagnose(
    dataset: str | os.PathLike,
    *,
    out: str | os.PathLike | None = None,
    jobs: int | None = None,
    progress: Callable[[str], Any] | None = None,
) -> Diagnosis | Identification:
    """Finds in measured data of a robot what its simulation lacks, or the constants that a data set with ``[identify]`` asks for.

    Args:
        dataset: a dataset.toml, its folder, or ``preset:NAME``.
        out: a folder for the files that ``sfers diagnose`` writes.
        jobs: simulations at a time, by default one per processor. Results do not depend on it.
        progress: gets the current task in words. An exception in it ends the diagnosis.

    Raises:
        ExperimentError: the description is not valid; the message has file, line and key.
        DataError: a file cannot be read.
        DiagnosisError: the data allow no answer.
        KeyboardInterrupt: Ctrl-C is heard at once and ends the work when its next task begins, within seconds in general.
    """
    command = f"sfers_rs.diagnose({os.fspath(dataset)!r})"
    kind, text, files = _native.diagnose(os.fspath(dataset), command, jobs, progress)
    found = (Diagnosis if kind == "diagnosis" else Identification)(json.loads(text), dict(files))
    if out is not None:
        found.save(out)
    return found


def diagnose_plant(
    plant: Plant,
    *,
    name: str = "plant",
    out: str | os.PathLike | None = None,
    jobs: int | None = None,
    progress: Callable[[str], Any] | None = None,
) -> Diagnosis:
    """Finds in the measured runs of a plant what its model lacks, whatever simulates it.

    Args:
        plant: a :class:`sfers_rs.plant.Plant`, or any object with its attributes.
        name: of the plant, for the report.
        out: a folder for diagnosis.json, report.html and residuals.csv.
        jobs: predictions at a time. By default one, or one per processor if ``plant.parallel``. More than one means processes unless
            ``plant.parallel == "threads"``. Results do not depend on it.
        progress: gets the current task in words. An exception in it ends the diagnosis.

    Raises:
        TypeError, ValueError: the plant is not as :class:`~sfers_rs.plant.Plant` says; the message names the run and the shape.
        PredictionError: ``predict`` failed or returned what is no prediction.
        DiagnosisError: the nominal model cannot be simulated.
        KeyboardInterrupt: Ctrl-C ends the work, in ``predict`` too.
    """
    described = Described(plant)
    given = described.described | {"name": str(name)}
    parallel = getattr(plant, "parallel", False)
    if parallel not in (False, True, "processes", "threads"):
        raise ValueError(f'parallel is False, True, "processes" or "threads", not {parallel!r}')
    if jobs is None:
        jobs = _processors() if parallel else 1
    elif not isinstance(jobs, int) or not 1 <= jobs <= 1024:
        raise ValueError(f"jobs must be 1 to 1024, not {jobs!r}")
    command = f"sfers_rs.diagnose_plant({type(plant).__name__}(...), name={str(name)!r})"
    if jobs > 1 and parallel != "threads":
        workers = Workers(described, jobs)
        try:
            _, text, files = _native.diagnose_plant(given, command, workers.predict, workers.close, jobs, progress)
        finally:
            workers.close()
    else:
        threads = jobs if jobs > 1 else None
        _, text, files = _native.diagnose_plant(given, command, described.predict, lambda: None, threads, progress)
    found = Diagnosis(json.loads(text), dict(files), described.unit)
    if out is not None:
        found.save(out)
    return found
