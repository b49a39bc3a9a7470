"""Calls the API with random arguments, right and wrong: `random_api_calls.py COUNT SEED`. Any end but the last line is a fault."""

import random
import sys

import numpy as np

import sfers_rs as sf

#: What a wrong call may raise; anything else is a fault.
REFUSALS = (TypeError, ValueError, KeyError, OverflowError, RuntimeError, sf.SfersError)
NAMES = ["actuators", "motors_per_actuator", "damping_eta", "friction_low", "film", "width_mm", "mount", "material", "nonsense", "positive_gain"]
WAVEFORMS = ["dc", "sine", "step", "gait", "sequence", "csv", "nonsense"]


def number(draw):
    """A number, often a strange one."""
    odd = [0, -0.0, 1, -1, 2, 3, 1e-300, 1e300, float("nan"), float("inf"), 10**30, np.float32(0.3), np.int64(2), True, None, "1"]
    return draw.choice(odd) if draw.random() < 0.4 else draw.uniform(-2, 2)


def array(draw):
    """An array of a random shape and type."""
    shape = draw.choice([(), (0,), (1,), (3,), (5,), (2, 5), (3, 1), (1, 5), (2, 3, 5)])
    made = np.array([draw.choice([0.0, 100.0, -1500.0, 1e9, float("nan")]) for _ in range(int(np.prod(shape)))]).reshape(shape)
    return draw.choice([made, made.tolist(), made.astype(np.float32), made.astype(object), made.astype(str), np.flip(made), np.asfortranarray(made)])


def robot(draw):
    """A robot that may be impossible."""
    keys = {draw.choice(NAMES): number(draw) for _ in range(draw.randint(0, 3))}
    if draw.random() < 0.7:
        keys = {"motors_per_actuator": draw.randint(1, 3), "damping_eta": draw.uniform(0.005, 0.1)}
    return draw.choice([sf.Robot.cantilever, sf.Robot.crawler, sf.Robot.free])(**keys)


def drive(draw):
    """A drive that may be impossible."""
    kind = draw.randrange(7)
    if kind == 0:
        return sf.Drive.sampled(array(draw), array(draw))
    if kind == 1:
        return sf.Drive.gait(draw.choice(["crawl", "frog-v2", "nonsense"]), frequency_hz=number(draw))
    if kind == 2:
        return {"waveform": draw.choice(WAVEFORMS), draw.choice(["voltages_v", "amplitude_v", "file"]): array(draw)}
    if kind == 3:
        return lambda simulation: array(draw)
    return draw.choice([sf.Drive.dc, sf.Drive.step])(array(draw)) if kind < 6 else None


def call(draw, held):
    """One call; `held` keeps a simulation, a recording and a state for later ones."""
    kind = draw.randrange(9)
    if kind == 0 or "simulation" not in held:
        engine = draw.choice(["planar", "bullet", "planar", "nonsense"])
        step = draw.choice([1e-5, 1e-4, number(draw)])
        held["simulation"] = sf.Simulation(robot(draw), drive(draw), engine=engine, time_step_s=step)
    elif kind == 1:
        keys = {"time_step_s": draw.choice([1e-4, number(draw)]), "duration_s": draw.choice([0.002, 0.01])}
        held["recording"] = sf.run(robot(draw), drive(draw), engine="planar", **keys)
    elif kind == 2:
        draw.choice([held["simulation"].save, held["simulation"].follow_drive, lambda: held["simulation"].run_until(number(draw) * 1e-3)])()
    elif kind == 3:
        name = draw.choice(["joint_angles", "joint_rates", "joint_torques", "joint_voltages", "nodes", "node_velocities", "contacts", "time_s"])
        assert np.isfinite(np.asarray(getattr(held["simulation"], name)).tolist() if name != "contacts" else 0.0).all()
    elif kind == 4:
        held["state"] = held["simulation"].save()
    elif kind == 5:
        held["simulation"].restore(held.get("state", number(draw)))
    elif kind == 6 and "recording" in held:
        recording = held["recording"]
        draw.choice([recording.player, lambda: recording.plot(draw.choice(["shapes", "traces", "spectrum", "x"])), lambda: repr(recording)])()
    else:
        held["simulation"].step(draw.choice([0, 1, 2, 3, 20, -1, number(draw)]), draw.choice([None, array(draw)]))


def main(count: int, seed: int) -> None:
    draw, held, taken = random.Random(seed), {}, 0
    for _ in range(count):
        try:
            call(draw, held)
            taken += 1
        except REFUSALS:
            pass
    print(f"{count} calls, {taken} of them taken")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
