"""Error against time step on both engines, for docs/performance.md.

Usage: .venv/bin/python scripts/convergence.py [PLOT.svg]

The tip of the cantilever 0.1 s after a step to -1500 V: its distance from where the planar engine finds it at 1e-6 s.
"""

import math
import pathlib
import subprocess
import sys
import tempfile

import numpy

SFERS = pathlib.Path(__file__).resolve().parent.parent / "target/release/sfers"
PLANAR = [8e-4, 4e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5]
BULLET = [2e-5, 1e-5, 5e-6, 2e-6]


def tip(engine, step, folder):
    """x and z (mm) at 0.1 s."""
    out = folder / "run.npz"
    steps = round(0.1 / step) + 1
    text = subprocess.run([SFERS, "preset", "cantilever-step"], capture_output=True, text=True, check=True).stdout
    text = text.replace("duration_s = 0.5", f"steps = {steps}")
    command = [SFERS, "run", "-", "--quiet", "--engine", engine, "--out", out]
    command += ["--set", f"simulation.time_step_s={step}", "--set", f"simulation.record_every_steps={steps}"]
    subprocess.run(command, input=text, capture_output=True, text=True, check=True)
    return 10 * numpy.load(out)["dataPositions"][-1, -1, [0, 2]]


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        limit = tip("planar", 1e-6, folder)
        errors = {(e, h): math.dist(tip(e, h, folder), limit) for e, steps in (("planar", PLANAR), ("bullet", BULLET)) for h in steps}
        print("| time step (s) | planar (mm) | Bullet (mm) |\n| --- | --- | --- |")
        rows = ["chain.log10_time_step_s,log10_error_on_planar_mm,log10_error_on_bullet_mm,status"]
        for step in sorted({h for _, h in errors}, reverse=True):
            found = [errors.get((engine, step)) for engine in ("planar", "bullet")]
            print(f"| {step:g} | " + " | ".join("–" if e is None else f"{e:.2e}" for e in found) + " |")
            rows.append(f"{math.log10(step)}," + ",".join("" if e is None else str(math.log10(e)) for e in found) + ",ok")
        if sys.argv[1:]:
            table = folder / "results.csv"
            table.write_text("\n".join(rows) + "\n")
            subprocess.run([SFERS, "plot", table, "--out", sys.argv[1]], check=True)


if __name__ == "__main__":
    main()
