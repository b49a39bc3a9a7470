"""Time per step of the planar engine against the length of the robot, for docs/performance.md.

Usage: python3 scripts/scaling.py [PLOT.svg]

Robots of 1 to 320 actuators (m = 3) on the floor, friction 1, by 1e-4 s, in two motions: all actuators swing at 14 Hz, every other one
between 0 and -1500 V and the rest between 0 and 450 V; and in-place jumping at 14 Hz, in every group of five the inner three on and off.
Medians of five runs, in turn; the exponent is the slope of a straight line through the logarithms.
"""

import json
import math
import pathlib
import statistics
import subprocess
import sys
import tempfile

SFERS = pathlib.Path(__file__).resolve().parent.parent / "target/release/sfers"
COUNTS = [1, 5, 20, 80, 320]
ON = [0, 520, -1500, 520, 0]


def swinging(count):
    return f'waveform = "sine"\nfrequency_hz = 14\namplitudes_v = {[450 if i % 2 else -1500 for i in range(count)]}'


def jumping(count):
    volts = [ON[(i + 2 - count // 2) % 5] if count > 1 else -1500 for i in range(count)]
    phases = f"[{{ until = 0.5, voltages_v = {[0] * count} }}, {{ until = 1.0, voltages_v = {volts} }}]"
    return f'waveform = "sequence"\nperiod_s = {1 / 14}\nphases = {phases}'


def step(count, drive):
    """Microseconds per step."""
    steps = max(400000 // count // 8, 5000)
    text = f"""
[robot]
actuators = {count}
[robot.friction]
low = 1.0
film = "none"
[drive]
{drive(count)}
[simulation]
engine = "planar"
friction = "convex"
time_step_s = 1e-4
steps = {steps}
record_every_steps = {steps}
"""
    result = subprocess.run([SFERS, "run", "-", "--json", "--quiet"], input=text, capture_output=True, text=True, check=True)
    return 1e6 / json.loads(result.stdout)["steps_per_s"]


def main():
    motions = {"swinging": swinging, "jumping": jumping}
    times = {(motion, count): [] for motion in motions for count in COUNTS}
    for _ in range(5):
        for motion, count in times:
            times[motion, count].append(step(count, motions[motion]))
    medians = {key: statistics.median(values) for key, values in times.items()}
    print("| actuators | bodies | swinging (µs per step) | jumping (µs per step) |\n| --- | --- | --- | --- |")
    for count in COUNTS:
        print(f"| {count} | {3 * count + 1} | {medians['swinging', count]:.3g} | {medians['jumping', count]:.3g} |")
    for motion in motions:
        points = [(math.log(3 * count + 1), math.log(medians[motion, count])) for count in COUNTS]
        x, y = (statistics.mean(values) for values in zip(*points))
        exponent = sum((a - x) * (b - y) for a, b in points) / sum((a - x) ** 2 for a, _ in points)
        print(f"\n{motion}: exponent {exponent:.2f}", end="")
    print()
    if sys.argv[1:]:
        with tempfile.TemporaryDirectory() as folder:
            rows = pathlib.Path(folder) / "results.csv"
            log = math.log10
            lines = ["chain.log10_bodies,log10_swinging_µs_per_step,log10_jumping_µs_per_step,status"]
            for count in COUNTS:
                lines.append(f"{log(3 * count + 1)},{log(medians['swinging', count])},{log(medians['jumping', count])},ok")
            rows.write_text("\n".join(lines) + "\n")
            subprocess.run([SFERS, "plot", rows, "--out", sys.argv[1]], check=True)


if __name__ == "__main__":
    main()
