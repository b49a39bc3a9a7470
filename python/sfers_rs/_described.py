"""Checks a plant and describes it in the numbers that the native half takes; calls its ``predict`` and checks what that returns."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .plant import BENCH, Candidate, Diverged, Model, Parameter, PredictionError, Run

#: Most characters of a name.
_LONGEST = 100


def _name(value: Any, of: str) -> str:
    if not isinstance(value, str) or not value or len(value) > _LONGEST or not value.isprintable():
        raise ValueError(f"{of} must be a text of 1 to {_LONGEST} printable characters, not {value!r}")
    return value


def _word(value: Any, of: str) -> str:
    if any(c.isspace() or c == "+" for c in _name(value, of)):
        raise ValueError(f"{of} {value!r} must have neither spaces nor plus signs")
    return value


def _number(value: Any, of: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{of} must be a finite number, not {value!r}")
    return number


def _array(value: Any, of: str) -> np.ndarray:
    try:
        array = np.asarray(value)
        return array.astype(float) if array.dtype.kind in "biuf" else np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{of} is no array of numbers: {error}") from None


def _table(value: Any, channels: Sequence[str], rows: int, of: str) -> np.ndarray:
    """Values of all channels, shape (rows, channels), from an array or a dict of arrays."""
    if isinstance(value, Mapping):
        if set(value) != set(channels):
            raise ValueError(f"{of} has the channels {sorted(map(str, value))}; needed are {list(channels)}")
        columns = [_array(value[channel], f"{of}[{channel!r}]") for channel in channels]
        for channel, column in zip(channels, columns):
            if column.shape != (rows,):
                raise ValueError(f"{of}[{channel!r}] has the shape {column.shape}; needed is ({rows},), as of times_s")
        return np.stack(columns, axis=1)
    array = _array(value, of)
    if array.shape == (rows,) and len(channels) == 1:
        array = array[:, None]
    if array.shape != (rows, len(channels)):
        also = f" or ({rows},)" if len(channels) == 1 else ""
        raise ValueError(f"{of} has the shape {array.shape}; needed is ({rows}, {len(channels)}){also}: rows of times_s, channels {list(channels)}")
    return array


class Described:
    """A plant that was checked.

    Args:
        plant: any object with the attributes of :class:`sfers_rs.plant.Plant`.

    Raises:
        TypeError, ValueError: naming what is wrong with the plant, with shapes.
    """

    def __init__(self, plant: Any):
        for attribute in ("runs", "channels", "candidates", "predict"):
            if not hasattr(plant, attribute):
                raise TypeError(f"a plant has runs, channels, candidates and predict(model, run); this {type(plant).__name__} has no {attribute}")
        if not callable(plant.predict):
            raise TypeError(f"predict of {type(plant).__name__} is a {type(plant.predict).__name__}, not a function of a model and a run")
        self.plant = plant
        self.channels = [_word(channel, "channel") for channel in plant.channels]
        measured, proposals = list(plant.runs), list(getattr(plant, "proposals", ()))
        #: The measured runs, then the proposed ones.
        self.runs: list[Run] = measured + proposals
        self.unit = str(getattr(plant, "unit", ""))
        self.constants = list(getattr(plant, "constants", ()))
        self.candidates: list[Candidate] = [constant.candidate() for constant in self.constants] + list(plant.candidates)
        if not self.channels or len(set(self.channels)) < len(self.channels):
            raise ValueError(f"channels {self.channels}: one or more names are needed, each once")
        if not measured:
            raise ValueError("the plant has no runs")
        ids = [_name(run.id, "the id of a run") for run in self.runs]
        if len(set(ids)) < len(ids):
            raise ValueError(f"two runs have the same id: {next(id for id in ids if ids.count(id) > 1)!r}")
        constants = [constant.id for constant in self.constants]
        if len(set(constants)) < len(constants) or set(constants) & {candidate.id for candidate in plant.candidates}:
            raise ValueError(f"the ids of constants must differ from each other and from those of candidates: {constants}")
        #: Used values of each run, shape (T, channels).
        self.used: list[np.ndarray] = []
        self.described = {
            "unit": self.unit,
            "channels": self.channels,
            "bench": self._bench(getattr(plant, "bench", {})),
            "runs": [self._run(run, run.measured) for run in measured],
            "proposals": [self._run(run, np.zeros((np.size(run.times_s), len(self.channels)))) for run in proposals],
            "candidates": [self._candidate(index, candidate) for index, candidate in enumerate(self.candidates)],
        }

    @staticmethod
    def _bench(given: Mapping[str, float | None]) -> list[float | None]:
        if unknown := set(given) - set(BENCH):
            raise ValueError(f"bench has the faults {', '.join(BENCH)}; not {', '.join(map(repr, unknown))}")
        # Faults that act within predict are none unless they are asked for.
        spreads = dict.fromkeys(BENCH[:3], 0.0) | dict.fromkeys(BENCH[3:]) | dict(given)
        for name, spread in spreads.items():
            if spread is not None and _number(spread, f"bench[{name!r}]") < 0.0:
                raise ValueError(f"bench[{name!r}] is a standard deviation, so not {spread!r}")
        return [spreads[name] for name in BENCH]

    def _run(self, run: Run, measured: Any) -> dict[str, Any]:
        of = f"run {run.id!r}"
        times = _array(run.times_s, f"{of}: times_s")
        if times.ndim != 1 or not len(times):
            raise ValueError(f"{of}: times_s has the shape {times.shape}; needed is (T,) with one row or more")
        if not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
            raise ValueError(f"{of}: times_s must rise and be finite; row {int(np.argmin(np.diff(times))) + 1 if len(times) > 1 else 0} does not")
        rows = len(times)
        measured = _table(measured, self.channels, rows, f"{of}: measured")
        used = np.isfinite(measured)
        if not used.any():
            raise ValueError(f"{of}: measured has no finite value, shape {measured.shape}")
        sigma = self._sigma(run.sigma, rows, f"{of}: sigma")
        if not (np.isfinite(sigma[used]).all() and (sigma[used] > 0.0).all()):
            raise ValueError(f"{of}: sigma, the standard deviation of the noise, must be above 0 and finite")
        inputs = np.zeros(rows) if run.inputs is None else _array(run.inputs, f"{of}: inputs")
        if inputs.shape != (rows,) or not np.isfinite(inputs).all():
            raise ValueError(f"{of}: inputs has the shape {inputs.shape}; needed are finite values, shape ({rows},), as of times_s")
        if run.role not in ("auto", "fit", "held-out"):
            raise ValueError(f"{of}: role is 'auto', 'fit' or 'held-out', not {run.role!r}")
        if not isinstance(run.nuisances, int) or not 0 <= run.nuisances <= rows:
            raise ValueError(f"{of}: nuisances is a number of unknowns, not {run.nuisances!r}")
        self.used.append(used)
        # Channel after channel.
        channels, at = np.nonzero(used.T)
        return {
            "id": run.id,
            "values": measured.T[used.T].tolist(),
            "sigmas": sigma.T[used.T].tolist(),
            "times": (times[at] - times[0]).tolist(),
            "channels": channels.tolist(),
            "inputs": inputs[at].tolist(),
            "start": float(times[0]),
            "role": run.role,
            "nuisances": run.nuisances,
            "moves_unaided": run.inputs is None if run.moves_unaided is None else bool(run.moves_unaided),
        }

    def _sigma(self, sigma: Any, rows: int, of: str) -> np.ndarray:
        if isinstance(sigma, Mapping):
            sigma = {channel: np.full(rows, value) if np.ndim(value) == 0 else value for channel, value in sigma.items()}
        elif np.ndim(sigma) == 0:
            sigma = np.full((rows, len(self.channels)), _number(sigma, of))
        elif np.shape(sigma) == (len(self.channels),) != (rows,):
            sigma = np.broadcast_to(_array(sigma, of), (rows, len(self.channels)))
        return _table(sigma, self.channels, rows, of)

    def _candidate(self, index: int, candidate: Candidate) -> dict[str, Any]:
        of = f"candidate {candidate.id!r}"
        _word(candidate.id, "the id of a candidate")
        parameters = list(candidate.parameters)
        if not parameters or len({p.name for p in parameters}) < len(parameters):
            raise ValueError(f"{of}: one or more parameters are needed, with names of their own")
        described = [_parameter(p, f"{of}, parameter {p.name!r}") for p in parameters]
        starts = candidate.starts if candidate.starts is not None else [[start for _, start in described]]
        if not len(starts) or any(len(start) != len(parameters) for start in starts):
            raise ValueError(f"{of}: starts must hold {len(parameters)} values for each start, one for each parameter")
        coordinates = [[_coordinate(p, _within(value, p, of), of) for value, p in zip(start, parameters)] for start in starts]
        curve = candidate.curve
        if curve is not None and len(curve.x) != len(parameters):
            raise ValueError(f"{of}: the curve has {len(curve.x)} abscissas and {len(parameters)} parameters; needed is one parameter for each")
        names = ("x_name", "x_unit", "y_name", "y_unit")
        return {
            "id": candidate.id,
            "kind": str(candidate.kind),
            "cause": str(candidate.cause) or f"{candidate.id.replace('-', ' ').capitalize()}.",
            "place": str(candidate.place) or candidate.id,
            "variant": bool(candidate.variant),
            "constant": index < len(self.constants),
            "parameters": [parameter for parameter, _ in described],
            "fixed": [(str(name), _number(value, f"{of}, fixed {name!r}")) for name, value in candidate.fixed.items()],
            "starts": coordinates,
            "curve": curve and {name: getattr(curve, name) for name in names} | {"x": _array(curve.x, f"{of}: x of the curve").tolist()},
        }

    def model(self, terms: Sequence[tuple[int, Sequence[float]]], fine: bool, shares: Sequence[float], base: Sequence[float]) -> Model:
        """The model that ``predict`` gets."""
        constants, effects = {constant.id: constant.nominal for constant in self.constants}, {}
        for index, values in terms:
            candidate = self.candidates[index]
            if index < len(self.constants):
                constants[candidate.id] = values[0]
            else:
                effects[candidate.id] = dict(candidate.fixed) | {p.name: value for p, value in zip(candidate.parameters, values)}
        clock, rate, gain = base
        return Model(constants, effects, fine, clock, rate, gain, tuple(shares))

    def predict(self, run: int, terms: Any, fine: bool, shares: Any, base: Any) -> np.ndarray | str:
        """The predicted values of a run in the order of its measured ones, or why the model cannot be simulated.

        Raises:
            PredictionError: naming the run, the model, and what is wrong with the prediction.
        """
        model, used = self.model(terms, fine, shares, base), self.used[run]
        of = f"predict(model, run {self.runs[run].id!r}) with constants {dict(model.constants)} and effects {dict(model.effects)}"
        try:
            predicted = self.plant.predict(model, self.runs[run])
        except Diverged as error:
            return str(error) or "the model diverged"
        except Exception as error:
            raise PredictionError(f"{of} raised {type(error).__name__}: {error}") from error
        try:
            table = _table(predicted, self.channels, len(used), "what it returned")
        except ValueError as error:
            raise PredictionError(f"{of}: {error}") from None
        values = table.T[used.T]
        if not np.isfinite(values).all():
            row = int(np.nonzero(~np.isfinite(np.where(used, table, 0.0)).all(axis=1))[0][0])
            hint = "raise sfers_rs.plant.Diverged where a model cannot be simulated"
            raise PredictionError(f"{of} returned a value that is not finite, first in row {row} of the shape {np.shape(predicted)}; {hint}")
        return np.ascontiguousarray(values)


def _parameter(p: Parameter, of: str) -> tuple[dict[str, Any], float]:
    """A parameter in the coordinate of the fit, and the value that it starts at."""
    _word(p.name, of)
    inverse = p.off is not None and math.isinf(p.off)
    bounds = tuple(p.bounds)
    is_valid = len(bounds) == 2 and not any(map(math.isnan, bounds)) and bounds[0] < bounds[1]
    if not is_valid or not (inverse and bounds[0] > 0.0 or all(map(math.isfinite, bounds))):
        more = " above 0, the largest of which may be infinite," if inverse else ""
        raise ValueError(f"{of}: bounds must be two finite numbers{more} in rising order, not {p.bounds!r}")
    low, high = (1.0 / bounds[1], 1.0 / bounds[0]) if inverse else bounds
    off = 0.0 if inverse else p.off
    if off is not None and not low <= off <= high and not inverse:
        raise ValueError(f"{of}: the value without effect, off={p.off!r}, is outside the bounds {p.bounds!r}")
    scale = _number(p.scale if p.scale is not None else 0.02 * (high - low), f"{of}, scale")
    if scale <= 0.0:
        raise ValueError(f"{of}: scale must be above 0, not {p.scale!r}")
    if p.start is not None:
        start = p.start
    else:
        about = 0.5 * (low + high) if off is None else off
        coordinate = about if off is None else about + scale if about + scale <= high else about - scale
        start = 1.0 / coordinate if inverse else coordinate
    described = {"name": p.name, "unit": str(p.unit), "off": off, "bounds": [low, high], "scale": scale, "inverse": inverse}
    return described, _within(start, p, of)


def _within(value: Any, p: Parameter, of: str) -> float:
    number = _number(value, f"{of}: start of {p.name!r}")
    if not p.bounds[0] <= number <= p.bounds[1]:
        raise ValueError(f"{of}: the start {value!r} of {p.name!r} is outside its bounds {p.bounds!r}")
    return number


def _coordinate(p: Parameter, value: float, of: str) -> float:
    return 1.0 / value if p.off is not None and math.isinf(p.off) else value
