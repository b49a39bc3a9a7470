"""A measured system with its model, whatever simulates it: what :func:`sfers_rs.diagnose_plant` takes.

A :class:`Plant` has measured runs, constants of its nominal model, candidate causes of model error, and ``predict``, which simulates a run with a
:class:`Model`: some constants and some causes with values. The diagnosis re-tunes the constants, adds causes as far as runs that were held out say that
they are needed, and says which cannot be told apart.

>>> import numpy as np
>>> class Cooling(Plant):
...     channels, unit = ["temperature"], "K"
...     constants = [Constant("time-constant", 20.0, bounds=(5.0, 80.0), unit="s")]
...     candidates = [Candidate("radiation", [Parameter("per_k", bounds=(0.0, 0.1))], cause="The body radiates.")]
...     def __init__(self, runs):
...         self.runs = runs
...     def predict(self, model, run):
...         y, step, out = run.data, run.times_s[1] - run.times_s[0], []
...         for _ in run.times_s:
...             out.append(y)
...             y -= step * y * (1 + y * model.effect("radiation", "per_k")) / model.constants["time-constant"]
...         return np.array(out)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from .errors import DiagnosisError

__all__ = ["BENCH", "Candidate", "Constant", "Curve", "Diverged", "Model", "Parameter", "Plant", "PredictionError", "Run"]

#: Faults of a bench that differ from run to run: clock offset (s), clock rate (-), gain of the inputs (-), scale of the signals (-), zero (unit of
#: the signals) and drift (per second) of each channel.
BENCH = ("clock_s", "clock_rate", "input_gain", "scale", "zero", "drift_per_s")


class Diverged(Exception):
    """Raised by ``predict`` for a model that cannot be simulated: it is passed over, and the diagnosis goes on with others."""


class PredictionError(DiagnosisError):
    """``predict`` failed, or returned what is no prediction; the message names the run, the model, and the shape."""


@dataclass(frozen=True)
class Parameter:
    """A number of a cause, to be fitted.

    Attributes:
        name: without spaces.
        bounds: least and largest value. With ``off=math.inf`` the largest may be infinite.
        unit: "" for dimensionless ones.
        off: the value at which the cause has no effect; None if this parameter cannot switch it off, as the width of a curve; ``math.inf`` for one
            that does so as it grows, as a time constant of creep: 1/value is then fitted.
        scale: a typical change of the value (of 1/value with ``off=math.inf``), by default a fiftieth of its range. Derivatives are differences over a fiftieth of
            that, which the simulation has to resolve.
        start: the value that the fit starts at; by default ``off`` and one scale, or the middle of the range.
    """

    name: str
    bounds: tuple[float, float]
    unit: str = ""
    off: float | None = 0.0
    scale: float | None = None
    start: float | None = None


@dataclass(frozen=True)
class Constant:
    """A constant of the nominal model, which is re-tuned before causes are tried. ``predict`` always finds it in ``model.constants``.

    Attributes:
        id: its name, without spaces.
        nominal: its value in the nominal model.
        bounds: least and largest value.
        scale: a typical change, by default a twentieth of the nominal value or a fiftieth of the range.
        cause: what differs, in a sentence.
        place: the part of the model where it acts.
    """

    id: str
    nominal: float
    bounds: tuple[float, float]
    unit: str = ""
    scale: float | None = None
    cause: str = ""
    place: str = ""

    def candidate(self) -> Candidate:
        """The constant as the candidate that re-tunes it."""
        scale = self.scale if self.scale is not None else abs(0.05 * self.nominal) or 0.02 * (self.bounds[1] - self.bounds[0])
        high = self.nominal + scale <= self.bounds[1]
        parameter = Parameter("value", self.bounds, self.unit, self.nominal, scale, self.nominal + (scale if high else -scale))
        return Candidate(self.id, [parameter], self.cause or f"The {self.id.replace('-', ' ')} differs.", self.place, "calibration")


@dataclass(frozen=True)
class Curve:
    """What a free form stands for: a curve through the values of its parameters at the abscissas ``x``, for a law that nobody has written down."""

    x: Sequence[float]
    x_name: str
    y_name: str
    x_unit: str = ""
    y_unit: str = ""


@dataclass(frozen=True)
class Candidate:
    """A cause of model error that may be added to the model. It is in ``model.effects`` when it is.

    Attributes:
        id: its name, without spaces. Several candidates of one id are forms of one cause, which exclude each other.
        parameters: to be fitted, at least one.
        cause: the cause in a sentence.
        place: the part of the model where it acts, by default ``id``: causes of one place are rivals, which are tried instead of each other.
        kind: a word for reports.
        starts: values that fits start at, one list of values for each start; by default one, from the parameters.
        fixed: given numbers, which ``predict`` finds beside the parameters.
        variant: another law of the cause of this id, with a parameter for its shape: tried instead of the plain one, not in the search.
        curve: makes it a free form, which shows which law is missing at its place where no named one suits; a parameter for each of its abscissas.
    """

    id: str
    parameters: Sequence[Parameter]
    cause: str = ""
    place: str = ""
    kind: str = "physics"
    starts: Sequence[Sequence[float]] | None = None
    fixed: Mapping[str, float] = field(default_factory=dict)
    variant: bool = False
    curve: Curve | None = None


@dataclass(frozen=True)
class Model:
    """The nominal model with some causes, as ``predict`` gets it.

    Attributes:
        constants: the value of every constant.
        effects: of the causes that are part of the model, ``{id: {parameter: value}}``; empty for the nominal model.
        fine: True for half the time step, as in the final refit; a plant without steps of its own ignores it.
        clock_s, clock_rate, input_gain: faults of the run's bench, 0 unless ``Plant.bench`` asks for them. :meth:`times` and :meth:`inputs` apply them.
        nuisances: as many numbers between 0 and 1 as ``Run.nuisances``.
    """

    constants: Mapping[str, float]
    effects: Mapping[str, Mapping[str, float]]
    fine: bool = False
    clock_s: float = 0.0
    clock_rate: float = 0.0
    input_gain: float = 0.0
    nuisances: tuple[float, ...] = ()

    def effect(self, id: str, parameter: str, off: float = 0.0) -> float:
        """The value of a cause's parameter; ``off`` if the cause is not part of the model."""
        return self.effects.get(id, {}).get(parameter, off)

    def times(self, run: Run) -> np.ndarray:
        """The times (s) at which a run's values are to be predicted, shape (T,), on the clock of its inputs."""
        times = np.asarray(run.times_s, float)
        return times + self.clock_rate * (times - times[0]) + self.clock_s

    def inputs(self, run: Run) -> np.ndarray | None:
        """The run's inputs times their gain, shape (T,)."""
        return None if run.inputs is None else (1.0 + self.input_gain) * np.asarray(run.inputs, float)


@dataclass(frozen=True)
class Run:
    """A measured run.

    Attributes:
        id: its name.
        times_s: rising times (s), shape (T,).
        measured: shape (T, channels), or (T,) of one channel, or a dict from channel to (T,). NaN is a missing value. None for a proposal.
        sigma: standard deviation of the noise, in the unit of the signals: a number, shape (channels,) or (T, channels), or a dict from channel to
            a number or (T,). Its size is checked against what the best model leaves.
        inputs: the input that drives the run, shape (T,), as a force or a voltage; tests of residuals look for it, and the choice of held-out runs.
            None for a run that moves by itself.
        role: "fit", "held-out", or "auto" to let the diagnosis choose.
        data: whatever else ``predict`` needs, as the initial state or a finer input.
        moves_unaided: True if it moves under a constant input, as one released from a deflection; by default True without inputs.
        nuisances: number of unknowns of this run alone between 0 and 1, for ``Model.nuisances``.
    """

    id: str
    times_s: ArrayLike
    measured: ArrayLike | Mapping[str, ArrayLike] | None
    sigma: ArrayLike | Mapping[str, ArrayLike]
    inputs: ArrayLike | None = None
    role: Literal["auto", "fit", "held-out"] = "auto"
    data: Any = None
    moves_unaided: bool | None = None
    nuisances: int = 0


class Plant:
    """A measured system and its model. Derive from it, or use any object with the same attributes.

    Attributes:
        runs: the measured runs, three or more; with twelve or more some are kept to judge the result alone.
        channels: names of the signals, which all have the ``unit``.
        constants: of the nominal model, re-tuned first; may be empty.
        candidates: what may be missing.
        proposals: runs that could be measured next, with None for what was measured. Where the data cannot tell causes apart, the one in which they differ
            most becomes ``Diagnosis.next_experiment``.
        bench: standard deviations of faults that differ from run to run, by the names of :data:`BENCH`: None to estimate one, 0 for none. The
            default estimates scale, zero and drift, and has no others; those work only if ``predict`` asks ``model.times(run)`` and
            ``model.inputs(run)``.
        parallel: False calls ``predict`` on the caller's thread, one call at a time. True or "processes": in as many processes as ``jobs``, each with a
            copy of the plant. "threads": on several threads at a time, for a ``predict`` that allows this and releases the interpreter.
    """

    runs: Sequence[Run] = ()
    channels: Sequence[str] = ("y",)
    unit: str = ""
    constants: Sequence[Constant] = ()
    candidates: Sequence[Candidate] = ()
    proposals: Sequence[Run] = ()
    bench: Mapping[str, float | None] = {}
    parallel: bool | Literal["processes", "threads"] = False

    def predict(self, model: Model, run: Run) -> ArrayLike | Mapping[str, ArrayLike]:
        """The values of ``run`` that ``model`` predicts, in the shape of ``run.measured``.

        Two calls with the same arguments have to return the same values. Raise :class:`Diverged` for a model that cannot be simulated; any other exception
        ends the diagnosis with a :class:`PredictionError`, and so do values that are not finite.
        """
        raise NotImplementedError(f"{type(self).__name__} has no method predict(model, run)")

