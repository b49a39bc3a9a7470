"""The Python package's speed beside PyBullet's and the command's: paired runs, medians and their ratios.

    .venv/bin/python scripts/bench_python.py [PAIRS]

after `bash scripts/wheel.sh --test` and `cargo build --release`, on a machine that does nothing else. The robot on the floor has five actuators with three joints each, at rest.

* drop-in: the published simulator's calls of a step, through its client object, by PyBullet and by `sfers_rs.pybullet`: the loop of scripts/bench.py in both.
* API on Bullet: the same robot and steps by `sfers_rs.Simulation`, beside the same loop on PyBullet, with and without reading what the loop records.
* API on the planar engine: `Simulation.step` in chunks of 1000 beside the steps per second that `sfers run` reports of itself; and a closed loop of single steps.
"""

import json
import statistics
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import sfers_rs as sf
from bench import RESTING, ROOT

RESTING = tomllib.loads(RESTING)
STEPS = RESTING["simulation"]["steps"]


def by_calls(*module: str) -> float:
    """Steps per second by the published simulator's calls, on PyBullet or on a `module` that stands for it."""
    command = [sys.executable, *module, str(ROOT / "scripts" / "bench.py"), "--loop", "reference"]
    specification = json.dumps(sf.resolved(RESTING))
    result = subprocess.run(command, input=specification, capture_output=True, text=True, check=True)
    return json.loads(result.stdout.splitlines()[-1])


def planar(steps: int) -> dict:
    return RESTING | {"simulation": {"engine": "planar", "time_step_s": 1e-4, "steps": steps, "record_every_steps": steps}}


def stepped(experiment: dict, steps: int, chunk: int) -> float:
    """Steps per second by the simulation, in chunks."""
    simulation = sf.Simulation(experiment)
    begin = time.perf_counter()
    for _ in range(steps // chunk):
        simulation.step(chunk)
    return steps / (time.perf_counter() - begin)


def closed_loop(steps: int) -> float:
    """Steps per second with joint angles out and voltages in at every step."""
    simulation = sf.Simulation(planar(1))
    voltages = np.zeros(5)
    begin = time.perf_counter()
    for _ in range(steps):
        voltages[0] = 100 * simulation.joint_angles[0]
        simulation.step(1, voltages)
    return steps / (time.perf_counter() - begin)


def by_command(steps: int) -> float:
    """Steps per second that the command reports of itself."""
    path = Path(ROOT / "target" / "bench.toml")
    path.write_text(sf._native.toml(json.dumps(planar(steps))))
    command = [ROOT / "target" / "release" / "sfers", "run", path, "--json", "--quiet"]
    return json.loads(subprocess.run(command, check=True, capture_output=True).stdout)["steps_per_s"]


def paired(title: str, pairs: int, **ways) -> None:
    """Prints the medians of two ways, run in turn, and the ratio of the second to the first."""
    rates = [[way() for way in ways.values()] for _ in range(pairs)]
    medians = [statistics.median(column) for column in zip(*rates)]
    shown = ", ".join(f"{name.replace('_', ' ')} {rate:,.0f} steps/s" for name, rate in zip(ways, medians))
    print(f"{title}: {shown}, ratio {medians[1] / medians[0]:.2f}", flush=True)


def main() -> None:
    pairs = int(sys.argv[1]) if len(sys.argv) > 1 else 9
    paired("published calls", pairs, PyBullet=by_calls, drop_in=lambda: by_calls("-m", "sfers_rs.pybullet"))
    paired("Bullet", pairs, PyBullet=by_calls, Simulation=lambda: stepped(RESTING, STEPS, 1000))
    paired("planar engine", pairs, command=lambda: by_command(10**6), Simulation=lambda: stepped(planar(1), 10**6, 1000))
    print(f"planar engine, single steps: {statistics.median(stepped(planar(1), 10**5, 1) for _ in range(pairs)):,.0f} steps/s")
    print(f"planar engine, closed loop: {statistics.median(closed_loop(10**5) for _ in range(pairs)):,.0f} steps/s")


if __name__ == "__main__":
    main()
