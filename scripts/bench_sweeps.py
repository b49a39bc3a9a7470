#!/usr/bin/env python3
"""What dividing a sweep costs, and how long a finished one takes to be read again. Needs a release build.

    python3 scripts/bench_sweeps.py [POINTS] [SHARDS]

1. POINTS (default 100,000) planar points of 2,000 steps in one process, and in SHARDS (default 64) processes, two at a time: core seconds of both in turns (three
   pairs, ratio of the medians), numbers of files, equal bytes. The points' own time is that of one process: it holds reading and checking once.
2. A finished sweep of 1,000,000 rows, resumed: wall time and largest memory, three times.
"""

import concurrent.futures
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SFERS = Path(__file__).parents[1] / "target" / "release" / "sfers"
EXPERIMENT = """[robot]
actuators = 1
mount = "clamped"
[drive]
waveform = "dc"
voltages_v = [-500]
[simulation]
engine = "planar"
time_step_s = 1e-4
steps = {steps}
"""


def write(folder: Path, points: int, steps: int) -> None:
    (folder / "a.toml").write_text(EXPERIMENT.format(steps=steps))
    (folder / "s.toml").write_text(
        'experiment = "a.toml"\nmeasures = ["tip_deflection_mm"]\n[vary]\n'
        f'"robot.damping_eta" = {{ from = 0.01, to = 0.04, count = {points // 100} }}\n'
        '"robot.positive_gain" = { from = 1.0, to = 1.2, count = 100 }\n'
    )


def run(folder: Path, *arguments: str) -> None:
    subprocess.run([SFERS, "sweep", "s.toml", "--quiet", *arguments], cwd=folder, check=True, stdout=subprocess.DEVNULL)


def core_s(work) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    work()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def division(points: int, shards: int) -> None:
    ones, manies = [], []
    for _ in range(3):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            write(folder, points, 2000)
            ones.append(core_s(lambda: run(folder, "--out", "one", "--jobs", "2")))

            def all_shards() -> None:
                with concurrent.futures.ThreadPoolExecutor(2) as pool:
                    work = [pool.submit(run, folder, "--out", "many", "--jobs", "1", "--shard", f"{k}/{shards}") for k in range(1, shards + 1)]
                    [shard.result() for shard in work]
                run(folder, "--out", "many", "--merge")

            manies.append(core_s(all_shards))
            assert (folder / "one" / "results.csv").read_bytes() == (folder / "many" / "results.csv").read_bytes()
            files = len(os.listdir(folder / "many"))
            size = sum(path.stat().st_size for path in (folder / "many").iterdir())
    one, many = statistics.median(ones), statistics.median(manies)
    print(f"{points} points in one process: {one:.1f} core s; in {shards} shards and a merge: {many:.1f} core s, {100 * (many / one - 1):+.1f} %")
    print(f"files: {files}, {size / 1e6:.1f} MB; results.csv has the same bytes")


def resume(points: int) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(folder, points, 10)
        run(folder, "--out", "out")
        size = sum(path.stat().st_size for path in (folder / "out").iterdir())
        for _ in range(3):
            begin = time.perf_counter()
            report = folder / "report"
            subprocess.run(
                ["/usr/bin/python3", "-c", "import resource, subprocess, sys\nsubprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)\n"
                 "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)", SFERS, "sweep", "s.toml", "--quiet", "--out", "out"],
                cwd=folder, check=True, stdout=report.open("w"))
            wall = time.perf_counter() - begin
            print(f"{points} finished rows ({size / 1e6:.0f} MB of files) resumed in {wall:.2f} s, {int(report.read_text()) / 1024:.0f} MB")


if __name__ == "__main__":
    if not SFERS.exists():
        sys.exit(f"{SFERS} is missing: cargo build --release")
    division(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000, int(sys.argv[2]) if len(sys.argv) > 2 else 64)
    resume(1_000_000)
