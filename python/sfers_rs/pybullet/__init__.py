"""PyBullet's functions that the published simulator calls, on this package's own Bullet, with PyBullet's numbers.

Code written for PyBullet runs on it unmodified: `python -m sfers_rs.pybullet script.py`, or `install()` before it imports pybullet.
"""

import sys
from typing import NoReturn

from .._native import pybullet as _native

DIRECT = _native.DIRECT
SHARED_MEMORY = _native.SHARED_MEMORY
GEOM_BOX = _native.GEOM_BOX
JOINT_REVOLUTE = _native.JOINT_REVOLUTE
JOINT_FIXED = _native.JOINT_FIXED
VELOCITY_CONTROL = _native.VELOCITY_CONTROL
TORQUE_CONTROL = _native.TORQUE_CONTROL
error = _native.error

connect = _native.connect
disconnect = _native.disconnect
resetSimulation = _native.resetSimulation
setTimeStep = _native.setTimeStep
setGravity = _native.setGravity
stepSimulation = _native.stepSimulation
resetDebugVisualizerCamera = _native.resetDebugVisualizerCamera
setAdditionalSearchPath = _native.setAdditionalSearchPath
saveBullet = _native.saveBullet
restoreState = _native.restoreState
createCollisionShape = _native.createCollisionShape
createMultiBody = _native.createMultiBody
loadURDF = _native.loadURDF
createConstraint = _native.createConstraint
changeDynamics = _native.changeDynamics
setJointMotorControl2 = _native.setJointMotorControl2
setJointMotorControlArray = _native.setJointMotorControlArray
getNumJoints = _native.getNumJoints
getJointState = _native.getJointState
getJointStates = _native.getJointStates
getLinkState = _native.getLinkState
getLinkStates = _native.getLinkStates
getBasePositionAndOrientation = _native.getBasePositionAndOrientation
getBaseVelocity = _native.getBaseVelocity
getEulerFromQuaternion = _native.getEulerFromQuaternion

__all__ = [name for name in dir() if not name.startswith("_") and name not in ("sys", "NoReturn")]


class NotProvided(AttributeError, error):
    """A name of PyBullet's that this drop-in does not have."""


def __getattr__(name: str) -> NoReturn:
    if name.startswith("__"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    raise NotProvided(
        f"pybullet.{name} is not in this drop-in, which has only what the published simulator calls; "
        "if you need it, ask on the issue tracker of sfers-rs"
    )


def install() -> None:
    """Makes `import pybullet`, `pybullet_utils.bullet_client` and `pybullet_data` find this drop-in, in this process and its forks."""
    from . import metadata, pybullet_data, pybullet_utils
    from .pybullet_utils import bullet_client

    sys.modules["pybullet"] = sys.modules[__name__]
    sys.modules["pybullet_data"] = pybullet_data
    sys.modules["pybullet_utils"] = pybullet_utils
    sys.modules["pybullet_utils.bullet_client"] = bullet_client
    if not any(isinstance(finder, metadata.Finder) for finder in sys.meta_path):
        sys.meta_path.append(metadata.Finder())


__all__ += ["NotProvided", "install"]
