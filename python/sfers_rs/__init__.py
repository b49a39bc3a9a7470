"""Planar piezoelectric soft robots: simulated as published on Bullet, bit for bit, or on a fast planar engine; and measured data diagnosed.

>>> import sfers_rs as sf
>>> robot = sf.Robot.crawler(damping_eta=0.045, friction_low=1.2, friction_high=4.0)
>>> recording = sf.run(robot, sf.Drive.gait("crawl", frequency_hz=5), engine="planar", time_step_s=1e-4, duration_s=0.5)
>>> sorted(recording.measures)[:3]
['aerial', 'body_touching', 'displacement_sum_mm']

Inside, everything is CGS (cm, g, s, dyn, V, rad); units stand in the names of keys and arguments, or in the documentation of what has none.
"""

from . import errors, plant
from ._native import __version__
from .diagnosis import Diagnosis, Effect, Estimate, Identification, diagnose, diagnose_plant
from .errors import DataError, DiagnosisError, ExperimentError, SfersError, SimulationError
from .experiment import effects, keys, mjcf, preset, presets, resolved, run, urdf
from .plant import Plant
from .recording import Figure, Recording
from .robot import Drive, Robot
from .simulation import Simulation, State
from .sweeps import sweep

__all__ = [
    "DataError",
    "Diagnosis",
    "DiagnosisError",
    "Drive",
    "Effect",
    "Estimate",
    "ExperimentError",
    "Figure",
    "Identification",
    "Plant",
    "Recording",
    "Robot",
    "SfersError",
    "Simulation",
    "SimulationError",
    "State",
    "__version__",
    "diagnose",
    "diagnose_plant",
    "effects",
    "errors",
    "keys",
    "mjcf",
    "plant",
    "preset",
    "presets",
    "resolved",
    "run",
    "sweep",
    "urdf",
]
