"""The version that code finds which asks for that of an installed PyBullet."""

import importlib.metadata
import pathlib
from collections.abc import Iterator
from typing import Any

# The PyBullet whose numbers this drop-in gives.
VERSION = "3.2.7"


class Distribution(importlib.metadata.Distribution):
    """PyBullet's distribution, as far as its name and version."""

    def read_text(self, filename: str) -> str | None:
        return f"Metadata-Version: 2.1\nName: pybullet\nVersion: {VERSION}\n" if filename == "METADATA" else None

    def locate_file(self, path: Any) -> pathlib.Path:
        return pathlib.Path(__file__).parent / path


class Finder(importlib.metadata.DistributionFinder):
    """Finds that distribution where PyBullet itself is not installed."""

    def find_spec(self, *_: Any) -> None:
        """Finds no module."""
        return None

    def find_distributions(self, context: Any = importlib.metadata.DistributionFinder.Context()) -> Iterator[Distribution]:
        if context.name == "pybullet":
            yield Distribution()
