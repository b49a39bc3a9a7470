"""The native half of the package."""

from collections.abc import Callable
from typing import Any

import numpy as np

__version__: str

_Found = tuple[str, str, list[tuple[str, str]]]

def diagnose(dataset: str, command: str, threads: int | None = None, progress: Callable[[str], Any] | None = None) -> _Found: ...
def diagnose_plant(
    given: dict[str, Any],
    command: str,
    predict: Callable[[int, list[tuple[int, list[float]]], bool, list[float], list[float]], np.ndarray | str],
    stopped: Callable[[], Any],
    threads: int | None = None,
    progress: Callable[[str], Any] | None = None,
) -> _Found: ...
