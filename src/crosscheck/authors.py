"""Runs one drive of the authors' own `sfers` package and writes the recording that it holds afterwards.

This is the second far side of `sfers crosscheck`: not the recipe rewritten (that is reference.py) but the published classes, from a
checkout on disk. Input, one JSON object on standard input:

    sfers_dir   folder that holds the package `sfers`, or a checkout that holds it in `src`
    class       name of a class in sfers.robot_simulation.inchworm_envs
    parameter   its parameter set, for example "trimorph parameter 2"
    settings    attributes to set before the drive, by name
    mode, arg   dc [[V]] | ac [m, f, L] | step null: the cantilever's drives
                drive [period or delay, ...]: a robot's
                dcscan [voltages] | lenscan [length in cm]: a scan class at one point
    out         the recording (NPZ)

Output: one line with the versions used. The classes' own progress goes to standard error, and they are told to save nothing.
Exit codes: 0 done; 3 PyBullet, the package, the class, or a method or attribute that is needed cannot be found; 1 anything else.
"""

import importlib
import importlib.metadata
import json
import os
import platform
import sys

# The classes and Bullet print to stdout. Keep the real one for the answer and send the rest to stderr.
ANSWER = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
os.environ.setdefault("MPLBACKEND", "Agg")  # no window, should they plot

MODULE = "sfers.robot_simulation.inchworm_envs"
SERIES = ("dataTime", "dataTheta", "dataAngularVelocities", "dataTor", "dataMotorVoltages", "dataPositions", "dataPositionVelocities")
SCALARS = ("timeStep", "simCycles", "recordStepInterval", "N", "m", "actuatorLength", "drivenFrequency", "dampingEta")

# Each drive's method, as it is spelled now and in older checkouts.
METHODS = {
    "dc": ("actuator_dc_drive", "actuatorDCDrive"),
    "ac": ("actuator_ac_drive", "actuatorACDrive"),
    "step": ("step_drive", "stepDrive"),
    "drive": ("robot_drive", "robotDrive"),
}


def fail(message):
    """Ends the program with one line on standard error."""
    print("authors.py: " + " ".join(str(message).split()), file=sys.stderr, flush=True)
    sys.exit(3)


def load_class(directory, name):
    """The class `name` of the checkout in `directory`."""
    if os.path.isdir(os.path.join(directory, "src", "sfers")):
        directory = os.path.join(directory, "src")
    if not os.path.isdir(os.path.join(directory, "sfers")):
        fail(f"{directory} does not hold the package sfers, nor does a folder src in it; give the root of a checkout")
    sys.path.insert(0, directory)
    try:
        module = importlib.import_module(MODULE)
    except Exception as error:  # whatever stops an import stops this program in the same way
        fail(f"cannot import {MODULE} from {directory}: {type(error).__name__}: {error}")
    if not hasattr(module, name):
        fail(f"{MODULE} has no class {name}")
    return getattr(module, name)


def drive(simulator, mode, arg):
    """Runs the drive on `simulator` itself. (A scan class's own `drive` runs copies, whose data would be lost.)"""
    if mode == "dcscan":
        simulator.voltage = tuple(arg[0])
        mode, arg = "drive", [None]
    elif mode == "lenscan":
        simulator.actuatorLength = arg[0]
        mode, arg = "drive", [simulator.period]
    if mode not in METHODS:
        fail(f"unknown mode {mode!r}")
    method = next((getattr(simulator, name) for name in METHODS[mode] if hasattr(simulator, name)), None)
    if method is None:
        fail(f"{type(simulator).__name__} has neither method {' nor '.join(METHODS[mode])}")
    arguments = [] if mode == "step" and arg is None else [arg]
    method(*arguments, saving=False, closing=True)


def main():
    spec = json.load(sys.stdin)
    try:
        import numpy
        import pybullet  # noqa: F401  (for a better message than the package's)
    except ImportError as error:
        fail(f"cannot import PyBullet and numpy with {sys.executable}: {error}")
    simulator = load_class(spec["sfers_dir"], spec["class"])(parameter=spec["parameter"])
    for name, value in spec["settings"].items():
        setattr(simulator, name, value)
    drive(simulator, spec["mode"], spec["arg"])
    missing = [name for name in SERIES + SCALARS if not hasattr(simulator, name)]
    if missing:
        fail(f"after its drive, {spec['class']} has no {', '.join(missing)}")
    with open(spec["out"], "wb") as file:  # a name instead of a file would get ".npz" appended
        numpy.savez(file, **{name: numpy.array(getattr(simulator, name)) for name in SERIES + SCALARS})
    versions = {name: importlib.metadata.version(name) for name in ("pybullet", "numpy")}
    print(json.dumps(versions | {"python": platform.python_version()}), file=ANSWER, flush=True)


if __name__ == "__main__":
    main()
