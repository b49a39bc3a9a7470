"""Files of `sfers urdf` and `sfers mjcf` in MuJoCo.

Usage: export_mujoco.py ROBOT.urdf ROBOT.xml SIDECAR.json STATIC_V STEP_V, all of the clamped cantilever. Prints one JSON object: masses that both
files load with, the height of the tip (mm) settled under STATIC_V, and the frequency (Hz) and damping ratio at which it rings when the
voltage steps to STEP_V, from its turning points.
"""

import json
import math
import sys

import mujoco
import numpy


def tip(model, data):
    """Height (mm) of the far end of the last link."""
    last = model.nbody - 1
    half = model.geom_size[model.body_geomadr[last]][0]
    axis = data.xmat[last].reshape(3, 3)[:, 0]
    return 10 * (data.xpos[last] + 2 * half * axis)[2]


def turning_points(times, values):
    points = []
    for i in range(1, len(values) - 1):
        a, b, c = values[i - 1 : i + 2]
        if (b - a) * (c - b) < 0:
            shift = 0.5 * (a - c) / (a - 2 * b + c)
            points.append((times[i] + shift * (times[i] - times[i - 1]), b - 0.25 * (a - c) * shift))
    return points


def main():
    urdf, mjcf, sidecar, static_v, step_v = sys.argv[1:]
    side = json.load(open(sidecar))
    from_urdf = mujoco.MjModel.from_xml_path(urdf)
    model = mujoco.MjModel.from_xml_path(mjcf)
    angle = lambda volts: side["rest_angle_per_volt_rad_per_v"] * volts / side["motors_per_actuator"]

    model.opt.timestep = 1e-4
    data = mujoco.MjData(model)
    data.ctrl[:] = angle(float(static_v))
    damping = model.dof_damping.copy()
    model.dof_damping[:] = 20 * damping  # settles sooner, at the same place
    for _ in range(20000):
        mujoco.mj_step(model, data)
    moving = float(numpy.abs(data.qvel).max())
    static = tip(model, data)

    model.dof_damping[:] = damping
    model.opt.timestep = 1e-5
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    mujoco.mj_resetData(model, data)
    data.ctrl[:] = angle(float(step_v))
    times, heights = [], []
    for step in range(50000):
        mujoco.mj_step(model, data)
        if step % 10 == 0:
            mujoco.mj_forward(model, data)
            times.append(data.time)
            heights.append(tip(model, data))
    turns = turning_points(times, heights)[1:9]
    swings = [abs(b[1] - a[1]) for a, b in zip(turns, turns[1:])]
    half = (turns[-1][0] - turns[0][0]) / (len(turns) - 1)
    decrement = math.log(swings[0] / swings[-1]) / (len(swings) - 1)
    zeta = decrement / math.hypot(math.pi, decrement)
    natural = 1 / (2 * half) / math.sqrt(1 - zeta**2)
    print(json.dumps({
        "mujoco": mujoco.__version__,
        "urdf_mass": float(from_urdf.body_mass.sum()), "urdf_joints": int(from_urdf.njnt),
        "mjcf_mass": float(model.body_mass.sum()), "mjcf_joints": int(model.njnt),
        "tip_mm": static, "still_moving": moving,
        "resonance_hz": natural * math.sqrt(1 - 2 * zeta**2), "damping_ratio": zeta,
    }))


main()
