"""The native half of the package."""

from typing import Any

__version__: str
pybullet: Any
