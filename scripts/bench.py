"""Steps per second beside PyBullet, in one session: `.venv/bin/python scripts/bench.py` writes the table of docs/performance.md.

Two experiments, both with m = 3: the cantilever, and the five-actuator robot resting on the floor. Against each other, run in
turn so that a noisy machine treats all alike: `sfers run` recording every step and one that records only the ends; PyBullet in a
loop that makes the reference's own calls and keeps its lists, and in the leanest loop that PyBullet allows. Set-up is not counted.
Ratios are of medians.
"""

import importlib.util
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
SFERS = ROOT / "target/release/sfers"
ROUNDS = 9

CANTILEVER = """
[robot]
actuators = 1
mount = "clamped"
[drive]
waveform = "dc"
voltages_v = [-1000]
[simulation]
time_step_s = 4e-6
steps = 40000
"""
RESTING = """
[drive]
waveform = "dc"
voltages_v = [0, 0, 0, 0, 0]
[simulation]
time_step_s = 4e-6
steps = 12000
"""


def sfers(text, every, folder):
    """Steps per second of `sfers run`, and the resolved experiment."""
    out = folder / "run.npz"
    command = [SFERS, "run", "-", "--json", "--quiet", "--set", f"simulation.record_every_steps={every}", "--out", out]
    result = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
    spec = json.loads((folder / "run.npz.manifest.json").read_text())["resolved_cgs"]
    return json.loads(result.stdout)["steps_per_s"], spec


def pybullet(spec, mode):
    """Steps per second of a loop on PyBullet, in a process of its own."""
    command = [sys.executable, __file__, "--loop", mode]
    result = subprocess.run(command, input=json.dumps(spec), capture_output=True, text=True, check=True)
    return json.loads(result.stdout.splitlines()[-1])


def loop(mode):
    """Reads an experiment from standard input, steps it on PyBullet and prints the steps per second. Set-up is not counted."""
    module_spec = importlib.util.spec_from_file_location("reference", ROOT / "src/crosscheck/reference.py")
    reference = importlib.util.module_from_spec(module_spec)
    module_spec.loader.exec_module(reference)
    spec = json.load(sys.stdin)
    EI, beta, mass = reference.laminate(spec["material"])
    robot = reference.build(spec, mass)
    torques = reference.torque_law(spec, EI, beta)
    lists = [[] for _ in reference.SERIES]
    if mode == "reference":
        # The authors call PyBullet through its BulletClient, which finds and wraps the function anew at each call. This one is
        # put over the connection that build() made, instead of making its own.
        from pybullet_utils.bullet_client import BulletClient

        client = BulletClient.__new__(BulletClient)
        client._client, client._pid, client._shapes = 0, os.getpid(), {}
        reference.pybullet = client

    def keep(*record):
        for values, value in zip(lists, record):
            values.append(value)

    start = time.perf_counter()
    reference.simulate(spec, robot, torques, lambda _: mode == "reference", keep)
    rate = spec["steps"] / (time.perf_counter() - start)
    print(json.dumps(rate), file=reference.ANSWER, flush=True)


def main():
    print("| experiment | sfers, recording every step | sfers | PyBullet, reference's calls | PyBullet, leanest | vs reference's calls | vs leanest |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for title, text in (("cantilever, m = 3", CANTILEVER), ("five actuators resting on the floor, m = 3", RESTING)):
            steps = int(text.split("steps =")[1])
            runs = {"recording": [], "plain": [], "reference": [], "lean": []}
            for _ in range(ROUNDS):
                rate, spec = sfers(text, 1, folder)
                runs["recording"].append(rate)
                runs["plain"].append(sfers(text, steps, folder)[0])
                for mode in ("reference", "lean"):
                    runs[mode].append(pybullet(spec, mode))
            m = {key: statistics.median(values) for key, values in runs.items()}
            print(
                f"| {title} | {m['recording']:,.0f} | {m['plain']:,.0f} | {m['reference']:,.0f} | {m['lean']:,.0f} "
                f"| {m['recording'] / m['reference']:.2f}x | {m['plain'] / m['lean']:.2f}x |",
                flush=True,
            )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--loop"]:
        loop(sys.argv[2])
    else:
        main()
