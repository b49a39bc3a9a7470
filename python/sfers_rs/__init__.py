"""Planar piezoelectric soft robots."""

from ._native import __version__

__all__ = ["__version__"]
