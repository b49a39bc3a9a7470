"""Recordings: arrays with the reference's keys, measures, tables and pictures."""

from __future__ import annotations

import html
import io
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native

if TYPE_CHECKING:
    import pandas
    import xarray


def frame(page: str, height: int) -> str:
    """An HTML page as an element of a notebook."""
    return f'<iframe srcdoc="{html.escape(page, quote=True)}" style="width: 100%; height: {height}px; border: 0"></iframe>'


def read_csv(file: Any, **keys: Any) -> pandas.DataFrame:
    """A CSV file as pandas reads it, with numbers that are equal bit for bit: by default from pandas 3 on."""
    import pandas

    exact: dict[str, Any] = {"float_precision": "round_trip"} if int(pandas.__version__.split(".")[0]) < 3 else {}
    return pandas.read_csv(file, **exact, **keys)


class Figure:
    """A figure as SVG; notebooks show it."""

    def __init__(self, svg: str):
        self.svg = svg

    def _repr_svg_(self) -> str:
        return self.svg

    def save(self, path: str | os.PathLike, dpi: float = 300.0) -> None:
        """Writes FILE.svg, FILE.png (with ``dpi``) or FILE.pdf."""
        kind = Path(path).suffix.removeprefix(".")
        data = self.svg.encode() if kind == "svg" else _native.drawn(self.svg, kind, dpi)
        Path(path).write_bytes(data)


class Recording(Mapping[str, Any]):
    """A trajectory: T records of J joints and J + 2 nodes (left end, joints, right end), and the measures of its run.

    A mapping with the keys of the published simulator's NPZ files, in CGS units: ``dataTime`` (s, shape (T,)); ``dataTheta`` (rad), ``dataAngularVelocities`` (rad/s), ``dataTor``
    (dyn cm), ``dataMotorVoltages`` (V), shape (T, J); ``dataPositions`` (cm), ``dataPositionVelocities`` (cm/s, as the reference has them) and ``nodes_velocity`` (cm/s, of the nodes),
    shape (T, J + 2, 3); numbers as ``timeStep``, ``N``, ``m``. Arrays cannot be written to.

    Attributes:
        measures: names, with units, and values; only ``energy_error`` if ``trouble`` is not empty.
        trouble: what makes the measures worthless, in sentences.
        warnings: what is to be known of the measures.
    """

    measures: dict[str, float]
    trouble: list[str]
    warnings: list[str]

    def __init__(self, native: _native.Recording):
        self._native = native
        self._arrays = native.arrays()
        for value in self._arrays.values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        self.measures = dict(native.measures)
        self.trouble = native.trouble
        self.warnings = native.warnings

    @classmethod
    def load(cls, path: str | os.PathLike) -> Recording:
        """Reads an NPZ file of this program or of the published simulator."""
        return cls(_native.Recording.from_npz(Path(path).read_bytes(), os.fspath(path)))

    def __reduce__(self):
        native = self._native
        return _restored, (native.npz(), native.name, native.measures, native.trouble, native.warnings)

    def __getitem__(self, key: str) -> Any:
        return self._arrays[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._arrays)

    def __len__(self) -> int:
        return len(self._arrays)

    def __repr__(self) -> str:
        records, joints = self["dataTheta"].shape
        shown = ", ".join(f"{name} = {value:.4g}" for name, value in self.measures.items())
        said = "".join(f"\n  trouble: {line}" for line in self.trouble) + "".join(f"\n  warning: {line}" for line in self.warnings)
        return f"<Recording of {self._native.name}: {records} records, {joints} joints; {shown}{said}>"

    @property
    def time_s(self) -> np.ndarray:
        """Times of the records (s), shape (T,)."""
        return self["dataTime"]

    @property
    def nodes_mm(self) -> np.ndarray:
        """x and z of the nodes (mm), shape (T, J + 2, 2)."""
        return 10.0 * self["dataPositions"][:, :, ::2]

    def save(self, path: str | os.PathLike) -> None:
        """Writes FILE.npz (the keys above) or FILE.csv (units in the names of the columns)."""
        kind = Path(path).suffix
        if kind not in (".npz", ".csv"):
            raise ValueError(f"path: {os.fspath(path)!r} ends in neither .npz nor .csv")
        Path(path).write_bytes(self._native.npz() if kind == ".npz" else self._native.csv().encode())

    def to_pandas(self) -> pandas.DataFrame:
        """A table with a row for each record, ``t_s`` as its index, and units in the names of its columns, as in the CSV file."""
        return read_csv(io.StringIO(self._native.csv()), index_col="t_s")

    def to_xarray(self) -> xarray.Dataset:
        """A data set over ``time`` (s), ``joint`` (from 1), ``node`` (from 0) and ``axis`` (x, y, z); every variable has its unit as an attribute."""
        import xarray

        joints = ("time", "joint")
        variables = {
            "angle": (joints, self["dataTheta"], {"units": "rad"}),
            "rate": (joints, self["dataAngularVelocities"], {"units": "rad/s"}),
            "torque": (joints, self["dataTor"], {"units": "dyn cm"}),
            "voltage": (joints, self["dataMotorVoltages"], {"units": "V"}),
            "position": (("time", "node", "axis"), self["dataPositions"], {"units": "cm"}),
        }
        if "nodes_velocity" in self:
            variables["velocity"] = (("time", "node", "axis"), self["nodes_velocity"], {"units": "cm/s"})
        count = self["dataTheta"].shape[1]
        coordinates = {
            "time": ("time", self.time_s, {"units": "s"}),
            "joint": np.arange(1, count + 1),
            "node": np.arange(count + 2),
            "axis": ["x", "y", "z"],
        }
        return xarray.Dataset(variables, coordinates, dict(self.measures))

    def plot(self, kind: str = "traces") -> Figure:
        """A figure: ``"traces"`` (heights, travel and voltages over time), ``"shapes"`` (the robot at some times) or ``"spectrum"``."""
        return Figure(self._native.svg(kind))

    def player(self) -> str:
        """The motion as an HTML page with a player."""
        return self._native.player()

    def _repr_html_(self) -> str:
        return frame(self.player(), 560)


def _restored(npz: bytes, name: str, measures: list, trouble: list, warnings: list) -> Recording:
    return Recording(_native.Recording.from_npz(npz, name, measures, trouble, warnings))
