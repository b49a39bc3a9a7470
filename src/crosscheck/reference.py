"""The reference's recipe on PyBullet: one JSON experiment on standard input, one recording on disk.

This is the far side of `sfers crosscheck`. It is written from the published recipe and uses PyBullet's public calls only; laminate,
drive and torque law are computed here once more, so a mistake on either side shows. CGS units (cm, g, s, dyn, V) throughout.

Input: keys `material`, `actuators`, `motors_per_actuator`, `mount` (ground | clamped | free), `damping_eta` or `damping_time` (the
other null), `collision_thickness`, `positive_gain`, `friction`, `drive`, `time_step`, `steps`, `record_every_steps`, `out`; `velocity_limit` (cm/s
of the base, rad/s of base and joints) where it is not Bullet's 100.
Output: the recording in `out`, and on standard output one line with the versions used.

Exit codes: 0 done; 3 PyBullet or numpy cannot be imported; 4 PyBullet refused the robot, or the state stopped being finite.
The order of operations is part of the recipe: equal order, equal bits.
"""

import bisect
import importlib.metadata
import json
import math
import os
import platform
import sys

# Bullet prints to the C library's stdout. Keep the real one for the answer and send the rest to stderr.
ANSWER = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)


def fail(code, message):
    """Ends the program with one line on standard error."""
    print("reference.py: " + " ".join(str(message).split()), file=sys.stderr, flush=True)
    sys.exit(code)


try:
    import numpy
    import pybullet
    import pybullet_data
except ImportError as error:
    fail(3, f"cannot import PyBullet and numpy with {sys.executable}: {error}")


# ---- laminate ------------------------------------------------------------------------------------------------------------------


def laminate(mat):
    """(EI per unit width in dyn cm, beta in rad/V, mass in g) of one actuator."""
    h_p, h_a, h_s = mat["piezo_thickness"], mat["adhesive_thickness"], mat["substrate_thickness"]
    # A wide sheet strains in one direction only: moduli of plane strain. The adhesive's is given as such.
    E_p = mat["piezo_modulus"] / (1 - mat["piezo_poisson"] ** 2)
    E_s = mat["substrate_modulus"] / (1 - mat["substrate_poisson"] ** 2)
    E_a = mat["adhesive_modulus"]
    # Neutral axis above the top of the substrate, and the layers' centre lines above it.
    moment = E_p * h_p * (0.5 * h_p + h_a) + E_a * h_a * 0.5 * h_a - E_s * h_s * 0.5 * h_s
    axis = moment / (E_p * h_p + E_a * h_a + E_s * h_s)
    z_p, z_a, z_s = 0.5 * h_p + h_a - axis, 0.5 * h_a - axis, -0.5 * h_s - axis
    I_p, I_a, I_s = (1.0 / 12.0 * h**3 for h in (h_p, h_a, h_s))
    EI = E_p * I_p + E_a * I_a + E_s * I_s + E_p * h_p * z_p**2 + E_a * h_a * z_a**2 + E_s * h_s * z_s**2
    strain_per_volt = mat["d33"] * (1 + mat["piezo_poisson"]) / mat["electrode_pitch"]
    gamma = strain_per_volt * z_p * E_p * h_p / EI
    L = mat["actuator_length"]
    areal = mat["substrate_density"] * h_s + mat["piezo_density"] * h_p + mat["adhesive_density"] * h_a
    return EI, gamma * L, areal * mat["width"] * L


# ---- drive ---------------------------------------------------------------------------------------------------------------------

# Gaits that repeat: the actuators that are on ("1") in equal parts of the period.
CYCLES = {
    "inchworm": ("00000", "01110", "11110", "10000"),
    "inchworm-backward": ("00000", "01110", "01111", "00001"),
    "inchworm-reversed": ("00000", "10000", "11110", "01110"),
    "full-inchworm": ("00000", "00001", "01111", "11110", "10000"),
    "full-frictional-inchworm": ("00000", "10000", "11110", "01111", "00001"),
    "frog-v2": ("01110", "10000", "11110", "01111", "00001"),
    "crawl": ("00000", "01110"),
}

# Time (s) at which the delayed jumper lets go.
RELEASE = 0.059309

# Gaits that run once: from the parameter (s) to phases (until, mask). Afterwards all actuators are off.
SHOTS = {
    "jumper": lambda _: [(math.inf, "01110")],
    "jumper-delay": lambda d: [(d, "01110"), (RELEASE, "11111")] if d >= 0 else [(-d, "10001"), (RELEASE - d, "11111")],
    "jumper-pulse": lambda p: [((1 / 2) * p, "01110")],
    "jump-on-time": lambda d: [(d, "01110")],
    "mover": lambda _: [(0.03437491666666667, "10000"), (math.inf, "11110")],
    "mover-delay": lambda d: [(d, "10000"), (math.inf, "11110")],
    "mover-three-phase": lambda d: [(0.024, "10000"), (0.089, "11110"), (0.089 + d, "01111")],
}


def gait_mask(name, parameter):
    """The gait as a function of time (s): which actuators are on."""
    if name in SHOTS:
        phases = SHOTS[name](parameter)
        return lambda t: next((mask for until, mask in phases if t < until), "00000")
    masks, period = CYCLES[name], parameter
    n = len(masks)
    # The quotient first: (k/n)*p and k*p/n differ in the last bit.
    bounds = [(k / n) * period for k in range(1, n)]
    if name == "frog-v2":  # flat in the first fifth of the first period only
        return lambda t: "00000" if t < bounds[0] else masks[bisect.bisect_right(bounds, t % period)]
    return lambda t: masks[bisect.bisect_right(bounds, t % period)]


def waveform(drive, actuators):
    """The drive as a function of time (s): the voltages (V) of the actuators."""
    kind = drive["waveform"]
    if kind == "gait":
        mask, on = gait_mask(drive["gait"], drive["parameter"]), drive["on_voltages"]
        return lambda t: [v if bit == "1" else 0.0 for v, bit in zip(on, mask(t))]
    if kind == "dc":
        return lambda t: drive["voltages"]
    if kind == "sine":
        frequency = drive["frequency"]

        def sine(t):
            swing = 1 - math.cos(2 * math.pi * frequency * t)
            return [a / 2 * swing for a in drive["amplitudes"]]

        return sine
    if kind == "step":
        return lambda t: [0.0] * actuators if t < drive["at"] else drive["voltages"]
    if kind == "sequence":
        period, phases = drive["period"], drive["phases"]

        def sequence(t):
            t = t if period is None else t % period
            return next((voltages for until, voltages in phases if t < until), phases[-1][1])

        return sequence
    if kind == "table":
        times, rows = drive["times"], drive["voltages"]

        def table(t):
            after = bisect.bisect_right(times, t)
            if after in (0, len(times)):
                return rows[max(after - 1, 0)]
            t0, t1 = times[after - 1], times[after]
            share = (t - t0) / (t1 - t0)
            return [v0 + share * (v1 - v0) for v0, v1 in zip(rows[after - 1], rows[after])]

        return table
    raise ValueError(f"unknown waveform {kind!r}")


def motor_voltages(spec):
    """The drive as a function of time (s): V/m for each of the N*m joints (V)."""
    N, m, gain = spec["actuators"], spec["motors_per_actuator"], spec["positive_gain"]
    voltages = waveform(spec["drive"], N)

    def motors(t):
        values = voltages(t)
        if gain != 1:
            values = [v * gain if v > 0 else v for v in values]
        return [share for v in values for share in [v / m] * m]

    return motors


# ---- robot ---------------------------------------------------------------------------------------------------------------------


def frictions(spec):
    """Friction coefficient of each of the N*m + 1 bodies, from left to right."""
    friction, m = spec["friction"], spec["motors_per_actuator"]
    count = spec["actuators"] * m + 1
    film = math.ceil(m * friction["film_fraction"] + 0.5)
    left = friction["film"] == "both-ends"
    right = left or friction["film"] == "right-end"
    on_film = [(left and i < film) or (right and i >= count - film) for i in range(count)]
    return [friction["high"] if high else friction["low"] for high in on_film]


def build(spec, mass):
    """Makes the world and returns the robot's id. The order of calls decides the order of contacts, and so the last bits."""
    pybullet.connect(pybullet.DIRECT)
    mat, m, thickness = spec["material"], spec["motors_per_actuator"], spec["collision_thickness"]
    joints = spec["actuators"] * m
    link_length = mat["actuator_length"] / m
    half_link = link_length / 2

    def box(length, centre):
        """A box whose middle stands at x = `centre` (cm) in its body's frame."""
        half_extents = [length / 2, mat["width"] / 2, thickness / 2]
        return pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half_extents, collisionFramePosition=[centre, 0, 0])

    # The first and last body are half a link long. A link's frame stands in its joint, its centre half its length further.
    lengths = [link_length] * (joints - 1) + [half_link]
    robot = pybullet.createMultiBody(
        baseMass=mass / (2 * m),
        baseCollisionShapeIndex=box(half_link, 0),
        basePosition=[0, 0, 0],
        linkMasses=[mass / m] * (joints - 1) + [mass / (2 * m)],
        linkCollisionShapeIndices=[box(length, length / 2) for length in lengths],
        linkVisualShapeIndices=[-1] * joints,
        linkPositions=[[half_link / 2, 0, 0]] + [[link_length, 0, 0]] * (joints - 1),
        linkOrientations=[[0, 0, 0, 1]] * joints,
        linkInertialFramePositions=[[length / 2, 0, 0] for length in lengths],
        linkInertialFrameOrientations=[[0, 0, 0, 1]] * joints,
        linkParentIndices=list(range(joints)),
        linkJointTypes=[pybullet.JOINT_REVOLUTE] * joints,
        linkJointAxis=[[0, 1, 0]] * joints,
    )
    if robot < 0 or pybullet.getNumJoints(robot) != joints:
        raise pybullet.error(f"PyBullet cannot make a body of {joints} joints")
    for joint in range(joints):
        pybullet.setJointMotorControl2(robot, joint, pybullet.VELOCITY_CONTROL, force=0)
    pybullet.setTimeStep(spec["time_step"])
    pybullet.setGravity(0, 0, -mat["gravity"])

    undamped = {"linearDamping": 0, "angularDamping": 0, "jointDamping": 0}
    if spec["mount"] == "ground":
        # pybullet_data's plane is a box of 200 x 200 x 10 whose top is at 0; scaled by 10 and laid under the robot.
        plane = os.path.join(pybullet_data.getDataPath(), "plane.urdf")
        ground = pybullet.loadURDF(plane, [0, 0, -0.5 * thickness], globalScaling=10)
        pybullet.changeDynamics(ground, -1, lateralFriction=spec["friction"]["ground"])
        for link, coefficient in enumerate(frictions(spec), start=-1):
            pybullet.changeDynamics(robot, link, lateralFriction=coefficient, **undamped)
    elif spec["mount"] == "clamped":
        pybullet.changeDynamics(robot, -1, spinningFriction=0.001, rollingFriction=0.001, **undamped)
        pybullet.createConstraint(robot, -1, -1, -1, pybullet.JOINT_FIXED, [0, 0, 0], [0, 0, 0], [0, 0, 0])
    else:
        pybullet.changeDynamics(robot, -1, **undamped)
    if "velocity_limit" in spec:
        pybullet.changeDynamics(robot, -1, maxJointVelocity=spec["velocity_limit"])
    return robot


# ---- steps ---------------------------------------------------------------------------------------------------------------------

# What is recorded of every chosen step, in this order.
SERIES = ("dataTime", "dataTheta", "dataAngularVelocities", "dataTor", "dataMotorVoltages", "dataPositions", "dataPositionVelocities")


def torque_law(spec, EI, beta):
    """Torque (dyn cm) of each joint from its angle (rad), rate (rad/s) and motor voltage (V): eq. 1 of the paper."""
    half_link = spec["material"]["actuator_length"] / spec["motors_per_actuator"] / 2
    stiffness = -spec["material"]["width"] * ((EI / 2) / half_link)
    eta, damping_time = spec.get("damping_eta"), spec.get("damping_time")
    if eta is not None:
        damping_time = eta / (2 * math.pi * 1.0)

    def torques(theta, rates, volts):
        return [stiffness * ((a - -beta * v) + damping_time * r) for a, r, v in zip(theta, rates, volts)]

    return torques


def pose(robot, indices, half_link):
    """Positions (cm) and velocities (cm/s) of left end, joints and right end, as the reference reads and pairs them.

    The base is current; the joints and all that hangs on them come from the links' cached transforms, which lag one step behind.
    The joints' places go with the velocities of the links' centres of mass, and the ends lie in the plane y = 0.
    """
    base, base_turn = pybullet.getBasePositionAndOrientation(robot)
    base_velocity, base_rate = pybullet.getBaseVelocity(robot)
    links = pybullet.getLinkStates(robot, indices, computeLinkVelocity=1)
    last = pybullet.getLinkState(robot, indices[-1], computeLinkVelocity=1)

    def end(position, velocity, rate, angle, reach):
        """The point at `reach` from `position`, `angle` (rad) above +x, and `velocity` turned by the body's rate about +y."""
        x, z = reach * math.cos(angle), reach * math.sin(angle)
        return [position[0] + x, 0.0, position[2] + z], [velocity[0] + z * rate[1], 0.0, velocity[2] - x * rate[1]]

    base_pitch, last_pitch = pybullet.getEulerFromQuaternion(base_turn)[1], pybullet.getEulerFromQuaternion(last[5])[1]
    left, left_velocity = end(base, base_velocity, base_rate, math.pi - base_pitch, half_link / 2)
    right, right_velocity = end(last[4], last[6], last[7], -last_pitch, half_link)
    positions = [left, *(list(link[4]) for link in links), right]
    return positions, [left_velocity, *(list(link[6]) for link in links), right_velocity]


def simulate(spec, robot, torques, wanted, keep):
    """Steps the world. If `wanted(step)`, the state before that step goes to `keep`, in the order of `SERIES`."""
    m, dt = spec["motors_per_actuator"], spec["time_step"]
    indices, half_link = list(range(spec["actuators"] * m)), spec["material"]["actuator_length"] / m / 2
    drive, now = motor_voltages(spec), 0.0
    for step in range(spec["steps"]):
        volts = drive(now)  # at the time of the step before
        now = step * dt
        states = pybullet.getJointStates(robot, indices)
        theta, rates = [state[0] for state in states], [state[1] for state in states]
        forces = torques(theta, rates, volts)
        if wanted(step):
            keep(now, theta, rates, forces, volts, *pose(robot, indices, half_link))
        pybullet.setJointMotorControlArray(robot, indices, pybullet.TORQUE_CONTROL, forces=forces)
        pybullet.stepSimulation()


def record(spec, robot, torques):
    """The recording, by key."""
    every, last = spec["record_every_steps"], spec["steps"] - 1
    eta, rows = spec.get("damping_eta"), []

    def keep(now, theta, rates, forces, *others):
        if not all(map(math.isfinite, forces)):
            raise ArithmeticError(f"the state is not finite at t = {now} s")
        rows.append((now, theta, rates, forces, *others))

    simulate(spec, robot, torques, lambda step: (step + 1) % every == 0 or step in (0, last), keep)
    return {key: numpy.array(values) for key, values in zip(SERIES, zip(*rows))} | {
        "timeStep": spec["time_step"],
        "simCycles": spec["steps"],
        "recordStepInterval": every,
        "N": spec["actuators"],
        "m": spec["motors_per_actuator"],
        "actuatorLength": spec["material"]["actuator_length"],
        "drivenFrequency": spec["drive"].get("frequency", 1.0),
        "dampingEta": spec["damping_time"] * (2 * math.pi * 1.0) if eta is None else eta,
    }


def main():
    spec = json.load(sys.stdin)
    EI, beta, mass = laminate(spec["material"])
    torques = torque_law(spec, EI, beta)
    try:
        robot = build(spec, mass)
        recording = record(spec, robot, torques)
        with open(spec["out"], "wb") as file:  # a name instead of a file would get ".npz" appended
            numpy.savez(file, **recording)
        answer = {name: importlib.metadata.version(name) for name in ("pybullet", "numpy")}
        answer["python"] = platform.python_version()
    except (pybullet.error, ArithmeticError) as error:
        fail(4, error)
    print(json.dumps(answer), file=ANSWER, flush=True)


if __name__ == "__main__":
    main()
