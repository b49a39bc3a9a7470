"""PyBullet's functions that the published simulator calls. Units are the caller's; sfers uses CGS."""

from collections.abc import Sequence
from os import PathLike
from typing import Any, Final

import numpy as np

_Numbers = Sequence[float] | np.ndarray[Any, Any]
_Integers = Sequence[int] | range | np.ndarray[Any, Any]
_Vector = tuple[float, float, float]
_Quaternion = tuple[float, float, float, float]
_JointState = tuple[float, float, tuple[float, float, float, float, float, float], float]
_Path = str | PathLike[str]

DIRECT: Final = 2
SHARED_MEMORY: Final = 3
GEOM_BOX: Final = 3
JOINT_REVOLUTE: Final = 0
JOINT_FIXED: Final = 4
VELOCITY_CONTROL: Final = 0
TORQUE_CONTROL: Final = 1

class error(Exception): ...
class NotProvided(AttributeError, error): ...

def install() -> None: ...
def connect(method: int, key: Any = ..., options: Any = ..., **kwargs: Any) -> int: ...
def disconnect(physicsClientId: int = 0) -> None: ...
def resetSimulation(flags: int = 0, physicsClientId: int = 0) -> None: ...
def setTimeStep(timeStep: float, physicsClientId: int = 0) -> None: ...
def setGravity(gravX: float, gravY: float, gravZ: float, physicsClientId: int = 0) -> None: ...
def stepSimulation(physicsClientId: int = 0) -> tuple[()]: ...
def resetDebugVisualizerCamera(
    cameraDistance: float, cameraYaw: float, cameraPitch: float, cameraTargetPosition: _Numbers, physicsClientId: int = 0
) -> None: ...
def setAdditionalSearchPath(path: _Path, physicsClientId: int = 0) -> None: ...
def saveBullet(bulletFileName: _Path, physicsClientId: int = 0) -> None: ...
def restoreState(fileName: _Path | None = None, stateId: int = -1, physicsClientId: int = 0) -> None: ...
def createCollisionShape(
    shapeType: int,
    radius: Any = ...,
    halfExtents: _Numbers | None = None,
    *,
    collisionFramePosition: _Numbers | None = None,
    collisionFrameOrientation: _Numbers | None = None,
    physicsClientId: int = 0,
) -> int: ...
def createMultiBody(
    baseMass: float | None = None,
    baseCollisionShapeIndex: int = -1,
    baseVisualShapeIndex: int = -1,
    basePosition: _Numbers | None = None,
    baseOrientation: _Numbers | None = None,
    baseInertialFramePosition: _Numbers | None = None,
    baseInertialFrameOrientation: _Numbers | None = None,
    linkMasses: _Numbers | None = None,
    linkCollisionShapeIndices: _Integers | None = None,
    linkVisualShapeIndices: _Integers | None = None,
    linkPositions: Sequence[_Numbers] | None = None,
    linkOrientations: Sequence[_Numbers] | None = None,
    linkInertialFramePositions: Sequence[_Numbers] | None = None,
    linkInertialFrameOrientations: Sequence[_Numbers] | None = None,
    linkParentIndices: _Integers | None = None,
    linkJointTypes: _Integers | None = None,
    linkJointAxis: Sequence[_Numbers] | None = None,
    physicsClientId: int = 0,
) -> int: ...
def loadURDF(
    fileName: _Path,
    basePosition: _Numbers | None = None,
    baseOrientation: _Numbers | None = None,
    useMaximalCoordinates: int = 0,
    useFixedBase: int = 0,
    flags: int = 0,
    globalScaling: float | None = None,
    physicsClientId: int = 0,
) -> int: ...
def createConstraint(
    parentBodyUniqueId: int,
    parentLinkIndex: int,
    childBodyUniqueId: int,
    childLinkIndex: int,
    jointType: int,
    jointAxis: _Numbers,
    parentFramePosition: _Numbers,
    childFramePosition: _Numbers,
    parentFrameOrientation: _Numbers | None = None,
    childFrameOrientation: _Numbers | None = None,
    physicsClientId: int = 0,
) -> int: ...
def changeDynamics(
    bodyUniqueId: int,
    linkIndex: int,
    *,
    lateralFriction: float | None = None,
    spinningFriction: float | None = None,
    rollingFriction: float | None = None,
    linearDamping: float | None = None,
    angularDamping: float | None = None,
    jointDamping: float | None = None,
    maxJointVelocity: float | None = None,
    physicsClientId: int = 0,
) -> None: ...
def setJointMotorControl2(
    bodyUniqueId: int,
    jointIndex: int,
    controlMode: int,
    targetPosition: float | None = None,
    targetVelocity: float | None = None,
    force: float | None = None,
    positionGain: float | None = None,
    velocityGain: float | None = None,
    maxVelocity: float | None = None,
    physicsClientId: int = 0,
) -> None: ...
def setJointMotorControlArray(
    bodyUniqueId: int,
    jointIndices: _Integers,
    controlMode: int,
    targetPositions: _Numbers | None = None,
    targetVelocities: _Numbers | None = None,
    forces: _Numbers | None = None,
    positionGains: _Numbers | None = None,
    velocityGains: _Numbers | None = None,
    physicsClientId: int = 0,
) -> None: ...
def getNumJoints(bodyUniqueId: int, physicsClientId: int = 0) -> int: ...
def getJointState(bodyUniqueId: int, jointIndex: int, physicsClientId: int = 0) -> _JointState: ...
def getJointStates(bodyUniqueId: int, jointIndices: _Integers, physicsClientId: int = 0) -> tuple[_JointState, ...]: ...
def getLinkState(
    bodyUniqueId: int,
    linkIndex: int,
    computeLinkVelocity: int | None = None,
    computeForwardKinematics: int | None = None,
    physicsClientId: int = 0,
) -> tuple[Any, ...]: ...
def getLinkStates(
    bodyUniqueId: int,
    linkIndices: _Integers,
    computeLinkVelocity: int | None = None,
    computeForwardKinematics: int | None = None,
    physicsClientId: int = 0,
) -> tuple[Any, ...]: ...
def getBasePositionAndOrientation(bodyUniqueId: int, physicsClientId: int = 0) -> tuple[_Vector, _Quaternion]: ...
def getBaseVelocity(bodyUniqueId: int, physicsClientId: int = 0) -> tuple[_Vector, _Vector]: ...
def getEulerFromQuaternion(quaternion: _Numbers, physicsClientId: int = 0) -> _Vector: ...
