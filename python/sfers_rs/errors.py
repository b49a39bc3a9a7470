"""Exceptions of the package; all derive from :class:`SfersError`."""

from __future__ import annotations


class SfersError(Exception):
    """Whatever this package reports of its own."""

    def __reduce__(self):
        return type(self), self.args, self.__dict__


class ExperimentError(SfersError, ValueError):
    """An experiment, sweep or data set that cannot be run as it is written.

    Attributes:
        file: the file, or what stands for it, or None.
        line: the line in it as text, or None.
        key: the key at fault, as ``robot.damping_eta``, or None.
    """

    file: str | None = None
    line: str | None = None
    key: str | None = None


class SimulationError(SfersError, RuntimeError):
    """A simulation that went wrong: it diverged, or contact was not solved. The message says at which step and what to try."""


class DataError(SfersError, ValueError):
    """A file of data that cannot be read or written; the message says which and where."""


class DiagnosisError(SfersError, RuntimeError):
    """A diagnosis that is not possible, with the reason."""
