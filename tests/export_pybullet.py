"""A URDF of `sfers urdf` in PyBullet, beside the chain that the reference builds by createMultiBody.

Usage: export_pybullet.py ROBOT.urdf < spec.json, with the experiment's `resolved_cgs`. Both robots are driven by the same torque law from rest
with the same voltages; prints one JSON object: relative differences of masses, inertias and joint frames, the friction of the loaded
links, and the largest difference of joint angles and rates over the run, as a share of the largest angle and rate.
"""

import importlib.util
import json
import pathlib
import sys

spec_of = importlib.util.spec_from_file_location("reference", pathlib.Path(__file__).parent.parent / "src/crosscheck/reference.py")
reference = importlib.util.module_from_spec(spec_of)
spec_of.loader.exec_module(reference)
pybullet = reference.pybullet


def loaded(spec, path):
    """The robot of the URDF, set up as the reference sets up its own: no dampings, no motors, no limits."""
    pybullet.connect(pybullet.DIRECT)
    robot = pybullet.loadURDF(path, flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
    joints = pybullet.getNumJoints(robot)
    undamped = {"linearDamping": 0, "angularDamping": 0, "jointDamping": 0}
    for joint in range(-1, joints):
        pybullet.changeDynamics(robot, joint, **undamped)
    for joint in range(joints):
        pybullet.setJointMotorControl2(robot, joint, pybullet.VELOCITY_CONTROL, force=0)
    pybullet.setTimeStep(spec["time_step"])
    pybullet.setGravity(0, 0, -spec["material"]["gravity"])
    if spec["mount"] == "clamped":
        pybullet.createConstraint(robot, -1, -1, -1, pybullet.JOINT_FIXED, [0, 0, 0], [0, 0, 0], [0, 0, 0])
    return robot


def properties(robot):
    """Mass, inertia, inertial frame and joint frame of every link, from the base on, and its friction."""
    rows = []
    for link in range(-1, pybullet.getNumJoints(robot)):
        info = pybullet.getDynamicsInfo(robot, link)
        row = {"mass": [info[0]], "friction": [info[1]], "inertia": list(info[2]), "inertial_frame": list(info[3]) + list(info[4])}
        if link >= 0:
            joint = pybullet.getJointInfo(robot, link)
            # Axis, and the joint's place in the frame of the parent's centre of mass.
            row["joint_frame"] = list(joint[13]) + list(joint[14]) + list(joint[15])
        rows.append(row)
    return rows


def motion(spec, robot):
    EI, beta, _ = reference.laminate(spec["material"])
    records = []
    keep = lambda now, theta, rates, *others: records.append((theta, rates))
    reference.simulate(spec, robot, reference.torque_law(spec, EI, beta), lambda step: True, keep)
    return records


def difference(a, b):
    """The largest difference of two lists of numbers, as a share of the largest number."""
    largest = max(max(map(abs, a)), max(map(abs, b)), 1e-300)
    return max(abs(x - y) for x, y in zip(a, b)) / largest


def main():
    spec = json.load(sys.stdin)
    _, _, mass = reference.laminate(spec["material"])
    built = reference.build(spec, mass)
    expected, path = properties(built), motion(spec, built)
    pybullet.disconnect()
    robot = loaded(spec, sys.argv[1])
    found, driven = properties(robot), motion(spec, robot)
    answer = {"links": len(found), "expected_links": len(expected)}
    answer["frictions"] = [row["friction"][0] for row in found]
    for key in ("mass", "inertia", "inertial_frame", "joint_frame"):
        pairs = [(a[key], b[key]) for a, b in zip(expected, found) if key in a]
        answer[key] = max(difference(a, b) for a, b in pairs)
    for i, key in enumerate(("angles", "rates")):
        flat = lambda records: [value for record in records for value in record[i]]
        answer[key] = difference(flat(path), flat(driven))
    answer["largest_angle"] = max(abs(value) for record in path for value in record[0])
    answer["steps"] = len(driven)
    print(json.dumps(answer), file=reference.ANSWER, flush=True)


main()
