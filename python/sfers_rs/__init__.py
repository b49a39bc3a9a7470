"""Planar piezoelectric soft robots."""

from . import plant
from ._native import __version__
from .diagnosis import Diagnosis, Effect, Estimate, Identification, diagnose, diagnose_plant
from .plant import Plant

__all__ = ["Diagnosis", "Effect", "Estimate", "Identification", "Plant", "__version__", "diagnose", "diagnose_plant", "plant"]
