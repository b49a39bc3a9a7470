"""Scripts for PyBullet, run unmodified on PyBullet and on the drop-in: `scenarios.py NAME OUT` writes what was read, as text."""

import math
import os
import random
import sys
import tempfile

import pybullet as p
import pybullet_data


def chain(joints, client=0, clamped=False):
    """A chain like the published robot's, on the floor or clamped."""
    length = 0.6

    def box(size, centre):
        return p.createCollisionShape(
            p.GEOM_BOX, halfExtents=[size / 2, 1, 0.025], collisionFramePosition=[centre, 0, 0], physicsClientId=client
        )

    lengths = [length] * (joints - 1) + [length / 2]
    robot = p.createMultiBody(
        1.0,
        box(length / 2, 0),
        -1,
        [0, 0, 0],
        [0, 0, 0, 1],
        linkMasses=[0.1] * joints,
        linkCollisionShapeIndices=[box(size, size / 2) for size in lengths],
        linkVisualShapeIndices=[-1] * joints,
        linkPositions=[[length / 4, 0, 0]] + [[length, 0, 0]] * (joints - 1),
        linkOrientations=[[0, 0, 0, 1]] * joints,
        linkInertialFramePositions=[[size / 2, 0, 0] for size in lengths],
        linkInertialFrameOrientations=[[0, 0, 0, 1]] * joints,
        linkParentIndices=list(range(joints)),
        linkJointTypes=[p.JOINT_REVOLUTE] * joints,
        linkJointAxis=[[0, 1, 0]] * joints,
        physicsClientId=client,
    )
    for joint in range(joints):
        p.setJointMotorControl2(robot, joint, p.VELOCITY_CONTROL, force=0, physicsClientId=client)
    p.setTimeStep(1e-4, physicsClientId=client)
    p.setGravity(0, 0, -980, physicsClientId=client)
    if clamped:
        p.createConstraint(robot, -1, -1, -1, p.JOINT_FIXED, [0, 0, 0], [0, 0, 0], [0, 0, 0], physicsClientId=client)
        return robot
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    floor = p.loadURDF("plane.urdf", basePosition=[0, 0, -0.025], globalScaling=10.0, physicsClientId=client)
    p.changeDynamics(floor, -1, lateralFriction=0.3, physicsClientId=client)
    p.changeDynamics(floor, 0, lateralFriction=0.7, physicsClientId=client)  # there is no such link
    for link in range(-1, joints):
        p.changeDynamics(
            robot, link, lateralFriction=1.5, linearDamping=0, angularDamping=0, jointDamping=0, physicsClientId=client
        )
    return robot


def advance(robot, joints, steps, client=0):
    """Steps under a spring at every joint; what was read at each."""
    read = []
    for _ in range(steps):
        states = p.getJointStates(robot, range(joints), physicsClientId=client)
        forces = [-5000 * (state[0] - 0.2) - 10 * state[1] for state in states]
        p.setJointMotorControlArray(robot, range(joints), p.TORQUE_CONTROL, forces=forces, physicsClientId=client)
        p.stepSimulation(physicsClientId=client)
        links = p.getLinkStates(robot, range(joints), computeLinkVelocity=1, physicsClientId=client)
        base = p.getBasePositionAndOrientation(robot, physicsClientId=client)
        pitch = p.getEulerFromQuaternion(base[1])
        read.append((states, links, base, pitch, p.getBaseVelocity(robot, physicsClientId=client)))
    return read


def chains():
    """Robots on the floor and clamped, each in a client of its own, taking turns."""
    clients = [p.connect(p.DIRECT) for _ in range(3)]
    counts, clamped = [3, 9, 6], [False, False, True]
    robots = [chain(*made) for made in zip(counts, clients, clamped)]
    return [[advance(*one, 20, client) for *one, client in zip(robots, counts, clients)] for _ in range(10)]


def two_in_a_world():
    """Two robots that lie on one another."""
    p.connect(p.DIRECT)
    first, second = chain(3), chain(3)
    return [advance(first, 3, 2) + advance(second, 3, 2) for _ in range(100)]


def saved():
    """A run, the same restored, and the same in another client."""
    read = []
    for joints in (3, 9):
        p.connect(p.DIRECT)
        robot = chain(joints)
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "state.bullet")
            advance(robot, joints, 200)
            p.saveBullet(bulletFileName=file)
            read.append(advance(robot, joints, 100))
            p.restoreState(fileName=file)
            read.append(p.getLinkStates(robot, range(joints), computeLinkVelocity=1))
            read.append(advance(robot, joints, 100))
            p.disconnect()
            p.connect(p.DIRECT)
            p.restoreState(fileName=file) if chain(joints) == robot else None
            read.append(advance(robot, joints, 100))
            p.disconnect()
    return read


def rotation(draw):
    """A rotation drawn at random."""
    q = [draw.gauss(0, 1) for _ in range(4)]
    length = math.sqrt(sum(v * v for v in q))
    return [v / length for v in q]


def vector(draw, size):
    """A vector with elements up to `size`."""
    return [draw.uniform(-size, size) for _ in range(3)]


def shape(draw):
    """A box somewhere in its frame, of any orientation."""
    frame = {"halfExtents": [draw.uniform(0.05, 0.4) for _ in range(3)]}
    if draw.random() < 0.7:
        frame["collisionFramePosition"] = vector(draw, 0.3)
    if draw.random() < 0.4:
        frame["collisionFrameOrientation"] = rotation(draw)
    return p.createCollisionShape(p.GEOM_BOX, **frame)


def random_tree(draw, mass):
    """A tree of boxes in odd frames: its id and its number of links."""
    links = draw.randint(1, 8)
    turned = draw.random() < 0.6

    def turn():
        return rotation(draw) if turned else [0, 0, 0, 1]

    frame = {"baseInertialFramePosition": vector(draw, 0.1), "baseInertialFrameOrientation": turn()}
    axes = [[0, 1, 0], [1, 0, 0], [0.6, 0.8, 0], vector(draw, 1.0)]
    body = p.createMultiBody(
        mass,
        shape(draw),
        -1,
        [draw.uniform(-1, 1), draw.uniform(-1, 1), draw.uniform(0.1, 1.2)],
        turn(),
        linkMasses=[draw.uniform(0.2, 3) for _ in range(links)],
        linkCollisionShapeIndices=[shape(draw) if draw.random() < 0.85 else -1 for _ in range(links)],
        linkVisualShapeIndices=[-1] * links,
        linkPositions=[vector(draw, 0.5) for _ in range(links)],
        linkOrientations=[turn() for _ in range(links)],
        linkInertialFramePositions=[vector(draw, 0.2) for _ in range(links)],
        linkInertialFrameOrientations=[turn() for _ in range(links)],
        linkParentIndices=[draw.randint(0, i) for i in range(links)],
        linkJointTypes=[draw.choice([p.JOINT_REVOLUTE] * 3 + [p.JOINT_FIXED]) for _ in range(links)],
        linkJointAxis=[draw.choice(axes) for _ in range(links)],
        **(frame if draw.random() < 0.5 else {}),
    )
    return body, links


def control(draw, body, links):
    """Switches the motors off, sets them one by one or together, or leaves them; whether they are off."""
    way = draw.choice(["off", "off", "each", "all", "default"])
    if way in ("off", "each"):
        for joint in range(links):
            motor = {"targetVelocity": draw.uniform(-2, 2), "force": draw.uniform(0, 50)} if way == "each" else {"force": 0}
            p.setJointMotorControl2(body, joint, p.VELOCITY_CONTROL, **motor)
    elif way == "all":
        p.setJointMotorControlArray(body, range(links), p.VELOCITY_CONTROL, targetVelocities=[0.7] * links)
    return way == "off"


# Keys of changeDynamics, and the largest value to draw.
DYNAMICS = {
    "lateralFriction": 1.0,
    "spinningFriction": 0.1,
    "rollingFriction": 0.1,
    "linearDamping": 0.5,
    "angularDamping": 0.5,
    "jointDamping": 0.5,
}


def trees():
    """Random trees, free or fixed, most with a floor."""
    read = []
    for seed in range(100):
        draw = random.Random(seed)
        p.connect(p.DIRECT)
        fixed = draw.random() < 0.3
        floor = draw.random() < 0.8
        body, links = random_tree(draw, 0 if fixed else draw.uniform(0.5, 3))
        p.setTimeStep(draw.choice([1 / 240, 0.001]))
        p.setGravity(draw.uniform(-1, 1), 0, -9.8)
        off = control(draw, body, links)
        if floor:
            p.loadURDF(os.path.join(pybullet_data.getDataPath(), "plane.urdf"), globalScaling=draw.choice([1.0, 10.0]))
        for link in range(-1, links):
            changed = {key: draw.uniform(0, most) for key, most in DYNAMICS.items() if draw.random() < 0.3}
            p.changeDynamics(body, link, **changed)
        if draw.random() < 0.3:
            p.changeDynamics(body, -1, maxJointVelocity=3.0)
        if draw.random() < 0.3:
            p.createConstraint(body, -1, -1, -1, p.JOINT_FIXED, [0, 0, 0], vector(draw, 0.1), [0, 0, 1])
        for _ in range(40):
            if off:
                forces = [draw.uniform(-3, 3) for _ in range(links)]
                p.setJointMotorControlArray(body, range(links), p.TORQUE_CONTROL, forces=forces)
                p.setJointMotorControl2(body, links - 1, p.TORQUE_CONTROL, force=0.3)
            p.stepSimulation()
            links_read = p.getLinkStates(body, range(links), computeLinkVelocity=1)
            base = p.getBasePositionAndOrientation(body), p.getBaseVelocity(body)
            read.append((seed, p.getJointStates(body, range(links)), base, links_read, p.getNumJoints(body)))
        p.disconnect()
    return read


if __name__ == "__main__":
    with open(sys.argv[2], "w") as out:
        for line in globals()[sys.argv[1]]():
            print(repr(line), file=out)
