"""Calls the drop-in's functions with random arguments, right and wrong: `random_calls.py COUNT SEED`. Any end but the last line is a fault."""

import random
import sys

import numpy as np

from sfers_rs import pybullet as p

NAMES = sorted(
    name for name in p.__all__ if callable(getattr(p, name)) and name not in ("install", "NotProvided", "error")
)
KEYS = ["physicsClientId", "force", "forces", "lateralFriction", "jointDamping", "halfExtents", "collisionFramePosition", "fileName"]
KEYS += ["computeLinkVelocity", "targetVelocity", "maxJointVelocity", "globalScaling", "linkMasses", "velocityGain", "nonsense"]


def number(draw):
    """A number, often a strange one."""
    odd = [0, -0.0, 1, -1, 2, 3, 1e-300, 1e300, -1e300, float("nan"), float("inf"), 10**30, np.float32(0.3), np.int64(2), True]
    return draw.choice(odd) if draw.random() < 0.5 else draw.uniform(-2, 2)


def value(draw, depth=0):
    """Anything."""
    kind = draw.randrange(10 if depth < 3 else 4)
    if kind < 3:
        return draw.choice([draw.randint(-2, 4), number(draw)])
    if kind == 3:
        return draw.choice(["plane.urdf", "state", "", None, b"x", object(), {}, range(3), "/", "a\0b"])
    if kind < 6:
        return [number(draw) for _ in range(draw.choice([3, 3, 4, draw.randint(0, 6)]))]
    if kind == 6:
        return np.array([number(draw) for _ in range(3)], dtype=object if draw.random() < 0.2 else None)
    return [value(draw, depth + 1) for _ in range(draw.randint(0, 4))]


def good(draw, client, bodies):
    """A call that may well succeed."""
    body, many = draw.randrange(max(1, bodies)), draw.randint(0, 6)
    turned = [draw.uniform(-1, 1) for _ in range(4)]
    box = draw.randint(-1, 3)
    return draw.choice(
        [
            lambda: p.createCollisionShape(3, halfExtents=[draw.uniform(1e-3, 1)] * 3, physicsClientId=client),
            lambda: p.createMultiBody(
                draw.choice([0, 1, 1e-9, 1e9]), box, -1, turned[:3], turned,
                linkMasses=[draw.choice([0, 1, 1e6])] * many, linkCollisionShapeIndices=[box] * many, linkVisualShapeIndices=[-1] * many,
                linkPositions=[turned[1:]] * many, linkOrientations=[turned] * many, linkInertialFramePositions=[turned[:3]] * many,
                linkInertialFrameOrientations=[turned] * many, linkParentIndices=[draw.randint(0, i) for i in range(many)],
                linkJointTypes=[draw.choice([0, 4]) for _ in range(many)], linkJointAxis=[turned[:3]] * many, physicsClientId=client,
            ),
            lambda: p.setJointMotorControlArray(
                body, range(3), 1, forces=[draw.choice([1, 1e300, -1e9])] * 3, physicsClientId=client
            ),
            lambda: p.createConstraint(body, -1, -1, -1, 4, [0] * 3, turned[:3], turned[1:], physicsClientId=client),
            lambda: p.setGravity(draw.choice([0, 1e300]), 0, -9.8, physicsClientId=client),
            lambda: p.getLinkStates(body, range(4), 1, physicsClientId=client),
            lambda: p.saveBullet("state", physicsClientId=client),
            lambda: p.restoreState(fileName="state", physicsClientId=client),
            lambda: p.stepSimulation(physicsClientId=client),
            lambda: p.stepSimulation(physicsClientId=client),
        ]
    )  # fmt: skip


def main():
    """Calls, and counts what succeeded."""
    draw, succeeded, bodies = random.Random(int(sys.argv[2])), 0, 0
    for number_of_call in range(int(sys.argv[1])):
        client = draw.randint(0, 2)
        if number_of_call % 200 == 0:
            for used in range(3):
                try:
                    p.resetSimulation(physicsClientId=used)
                except p.error:
                    p.connect(p.DIRECT)
            bodies = 0
        try:
            if draw.random() < 0.5:
                good(draw, client, bodies)()
                bodies = min(bodies + 1, 8)
            else:
                keywords = {draw.choice(KEYS): value(draw) for _ in range(draw.randint(0, 2))}
                getattr(p, draw.choice(NAMES))(*[value(draw) for _ in range(draw.randint(0, 5))], **keywords)
            succeeded += 1
        except (p.error, TypeError, ValueError, OverflowError):
            pass
    assert succeeded > int(sys.argv[1]) / 10, succeeded
    print("succeeded", succeeded)


if __name__ == "__main__":
    main()
