"""Error against time step, for docs/performance.md.

Usage: .venv/bin/python scripts/convergence.py [FOLDER]

The tip of the cantilever 0.1 s after a step to -1500 V on both engines, from where the planar engine finds it at 1e-6 s; and on the planar engine the
furthest node of robots on the floor: one that stands on its ends and bends, where nothing lands, lifts off or slips, and a jump, a mover on films and
an inchworm, with all that they meet, from 2e-7 s. Plots go to FOLDER/convergence.svg and FOLDER/convergence-contact.svg.
"""

import json
import math
import pathlib
import subprocess
import sys
import tempfile

import numpy

SFERS = pathlib.Path(__file__).resolve().parent.parent / "target/release/sfers"
PLANAR = [8e-4, 4e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5]
BULLET = [2e-5, 1e-5, 5e-6, 2e-6]
FLOOR = [2e-4, 1e-4, 5e-5, 2e-5, 1e-5, 5e-6, 2e-6]
LIMIT = 2e-7
MOVER = ["robot.friction.low=0.2", "robot.friction.film_fraction=0.6666666666666666", "drive.delay_s=0.035"]
STANDS = """[robot]
actuators = 5
friction = { low = 4.0, film = "none" }
[drive]
waveform = "dc"
voltages_v = [0, -1000, -1000, -1000, 0]
[simulation]
"""


def run(folder, source, step, end, settings, *more, first=0):
    """x and z (mm) of the nodes `end` seconds after step number `first`."""
    out = folder / "run.npz"
    steps = first + round(end / step) + 1
    settings = [f"simulation.time_step_s={step}", f"simulation.steps={steps}", f"simulation.record_every_steps={steps - 1}", *settings]
    command = [SFERS, "run", "-", "--quiet", "--out", out, *more, *(part for setting in settings for part in ("--set", setting))]
    lines = [line for line in source.splitlines() if not line.startswith(("duration_s", "record_every_s", "time_step_s"))]
    subprocess.run(command, input="\n".join(lines), capture_output=True, text=True, check=True)
    return 10 * numpy.load(out)["dataPositions"][-1][:, [0, 2]]


def preset(name):
    return subprocess.run([SFERS, "preset", name], capture_output=True, text=True, check=True).stdout


def apart(a, b):
    return float(numpy.hypot(*(a - b).T).max())


def cantilever(folder):
    source = preset("cantilever-step")
    tip = lambda engine, step: run(folder, source, step, 0.1, [], "--engine", engine)[-1:]
    limit = tip("planar", 1e-6)
    return [{h: apart(tip(engine, h), limit) for h in steps} for engine, steps in (("planar", PLANAR), ("bullet", BULLET))]


def standing(folder):
    saved = folder / "stands.json"
    run(folder, STANDS, 1e-4, 0.9999, [], "--engine", "planar", "--save-state", saved)
    state = json.loads(saved.read_text())

    def nodes(step):
        state["robot"]["time_step"] = step
        (folder / "state.json").write_text(json.dumps(state))
        voltages = ["drive.voltages_v=[0,-900,-900,-900,0]"]
        more = ["--engine", "planar", "--load-state", folder / "state.json"]
        return run(folder, STANDS, step, 0.06, voltages, *more, first=10000)

    return errors(nodes)


def errors(nodes):
    limit = nodes(LIMIT)
    return {h: apart(nodes(h), limit) for h in FLOOR}


def on_the_floor(folder, name, end, settings=()):
    source = preset(name)
    return errors(lambda step: run(folder, source, step, end, settings, "--engine", "planar"))


def order(error):
    steps, errors = zip(*((math.log(h), math.log(e)) for h, e in error.items() if e > 0))
    return numpy.polyfit(steps, errors, 1)[0]


def show(folder, plot, columns):
    """Prints a table of the columns (title, name, errors by step) and draws it."""
    print("| time step (s) | " + " | ".join(title for title, _, _ in columns) + " |\n" + "| --- " * (len(columns) + 1) + "|")
    rows = ["chain.log10_time_step_s," + ",".join(f"log10_error_{name}_mm" for _, name, _ in columns) + ",status"]
    for step in sorted({h for *_, error in columns for h in error}, reverse=True):
        found = [error.get(step) for *_, error in columns]
        print(f"| {step:g} | " + " | ".join("–" if e is None else f"{e:.2e}" for e in found) + " |")
        rows.append(f"{math.log10(step)}," + ",".join("" if not e else str(math.log10(e)) for e in found) + ",ok")
    print("| order | " + " | ".join(f"{order(error):.2f}" for *_, error in columns) + " |\n")
    if sys.argv[1:]:
        table = folder / "results.csv"
        table.write_text("\n".join(rows) + "\n")
        subprocess.run([SFERS, "plot", table, "--out", pathlib.Path(sys.argv[1]) / plot], check=True)


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        planar, bullet = cantilever(folder)
        show(folder, "convergence.svg", [("planar (mm)", "on_planar", planar), ("Bullet (mm)", "on_bullet", bullet)])
        columns = [("stands and bends (mm)", "standing", standing(folder))]
        columns += [("jump at 14 Hz, 0.25 s", "jump", on_the_floor(folder, "jump-14hz", 0.25))]
        columns += [("mover, 0.3 s", "mover", on_the_floor(folder, "mover-three-phase", 0.3, MOVER))]
        columns += [("inchworm, 0.5 s", "inchworm", on_the_floor(folder, "inchworm", 0.5))]
        show(folder, "convergence-contact.svg", columns)


if __name__ == "__main__":
    main()
