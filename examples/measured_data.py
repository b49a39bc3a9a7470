"""Writes the measured data of the example data sets beside it, without anything of this program.

`two_clocks` and `one_point` are rows of tests/datasets/sample-tip-mass, whose independent simulator is described there. The others are closed forms
of a clamped Euler-Bernoulli beam with Kelvin-Voigt damping (modal sums, small deflections) of the constants of the preset parameter-2:

    q'' + 2 zeta w q' + w^2 q = w^2 q_static(t)     w = (beta L)^2 sqrt(EI/(m L^4))     zeta = eta w / 2

or, in `dropped`, parabolas of free flight.

Usage: python3 examples/measured_data.py
"""

import cmath
import csv
import math
import pathlib
import random

HERE = pathlib.Path(__file__).parent
SAMPLE = HERE.parent / "tests/datasets/sample-tip-mass"
# CGS: flexural rigidity of the whole width (dyn cm^2), mass per length (g/cm), length (cm), gravity (cm/s^2), damping time (s), curvature per
# volt (1/(cm V)).
EI, MASS, LENGTH, GRAVITY = 2 * 2519089.378622151, 4.80436 / 10, 10.0, 980.0
DAMPING_TIME = 0.008 / (2 * math.pi)
CURVATURE = 3.6327811654911875e-4 / 10
NOISE_MM = 0.05


class Mode:
    """A mode of the clamped beam with rigidity EI x stiffness, scaled so that its mean square is 1."""

    def __init__(self, number, stiffness=1.0, damping=1.0):
        low, high = (number - 0.9) * math.pi, number * math.pi
        for _ in range(200):
            middle = 0.5 * (low + high)
            value = lambda b: math.cos(b) + 1 / math.cosh(b)
            low, high = (middle, high) if value(low) * value(middle) > 0 else (low, middle)
        b = 0.5 * (low + high)
        sigma = (math.cosh(b) + math.cos(b)) / (math.sinh(b) + math.sin(b))
        self.rate = b * b * math.sqrt(EI * stiffness / MASS) / LENGTH**2
        self.zeta = 0.5 * damping * DAMPING_TIME * self.rate
        apart = cmath.sqrt(self.zeta**2 - 1)
        self.roots = [(-self.zeta + apart) * self.rate, (-self.zeta - apart) * self.rate]
        self.tip = math.cosh(b) - math.cos(b) - sigma * (math.sinh(b) - math.sin(b))
        tip_slope = b / LENGTH * (math.sinh(b) + math.sin(b) - sigma * (math.cosh(b) - math.cos(b)))
        scale = 1 / (MASS * LENGTH * self.rate**2)
        # Static coordinates of a force of 1 dyn at the tip, of 1 dyn/cm, and of 1 V.
        self.of_force = self.tip * scale
        self.of_load = 2 * sigma * LENGTH / b * scale
        self.of_volt = EI * stiffness * CURVATURE * tip_slope * scale

    def ringing(self, time):
        """Decay from 1 at rest."""
        a, b = self.roots
        return ((b * cmath.exp(a * time) - a * cmath.exp(b * time)) / (b - a)).real

    def response(self, frequency):
        """Complex coordinate over the static one."""
        ratio = 2 * math.pi * frequency / self.rate
        return 1 / (1 - ratio**2 + 2j * self.zeta * ratio)


    def driven(self, frequency, time, exposure):
        """Coordinate over the static one of 1 V under (1 - cos)/2 V from rest on, as the mean over an exposure about a time."""
        a, b = self.roots
        drive = 2j * math.pi * frequency
        h = self.response(frequency)
        # What is at rest at 0: 1 - Re(h) + x + y = 0 and -Re(drive h) + a x + b y = 0.
        rest, speed = h.real - 1, (drive * h).real
        x = (speed - b * rest) / (a - b)
        y = rest - x
        at = lambda root, sign: cmath.exp(root * (time + 0.5 * sign * exposure))
        mean = lambda root: (at(root, 1) - at(root, -1)) / (root * exposure)
        return 0.5 * (1 - (h * mean(drive)).real + (x * mean(a) + y * mean(b)).real)


def sag(stiffness=1.0):
    """Deflection of the tip by the weight (mm)."""
    return -10 * MASS * GRAVITY * LENGTH**4 / (8 * EI * stiffness)


def write(path, head, rows):
    path.parent.mkdir(exist_ok=True)
    with open(path, "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(head)
        out.writerows(rows)


def sample(run):
    with open(SAMPLE / f"{run}.csv", newline="") as file:
        return list(csv.DictReader(file))


def two_clocks():
    """Voltages in the rows of the sample, positions in every fourth, on a clock that starts later and is some milliseconds off."""
    for run, late_s in [("ac-12hz-400v", 0.0041), ("ac-18hz-1200v", -0.0028), ("square-7hz", 0.0035), ("ac-2hz-1500v", -0.0046)]:
        rows = [row for row in sample(run) if float(row["t_s"]) <= 1.0]
        write(HERE / f"two_clocks/{run}-volts.csv", ["t_s", "v1_v"], [[row["t_s"], row["v1_v"]] for row in rows])
        seen = [row for row in rows[::4] if float(row["t_s"]) >= 0.05]
        of = lambda row: [f"{float(row['t_s']) - late_s:.4f}", row["mid_z_mm"], row["tip_x_mm"], row["tip_z_mm"]]
        write(HERE / f"two_clocks/{run}-camera.csv", ["t_s", "mid_z_mm", "tip_x_mm", "tip_z_mm"], map(of, seen))


def one_point():
    """Every third row of the sample, and of its positions the height of the tip alone."""
    for run in ["ac-12hz-400v", "ac-18hz-400v", "square-7hz", "ac-2hz-1500v"]:
        rows = [row for row in sample(run) if float(row["t_s"]) <= 0.8][::3]
        write(HERE / f"one_point/{run}.csv", ["t_s", "v1_v", "tip_z_mm"], [[r["t_s"], r["v1_v"], r["tip_z_mm"]] for r in rows])


def released():
    """Free vibrations at 0 V of a sheet of 0.9 times the rigidity, let go from under a weight and from level."""
    noise = random.Random(1)
    stiffness = 0.9
    modes = [Mode(i + 1, stiffness) for i in range(8)]
    for name, grams in [("cut-3g", 3.0), ("cut-6g", 6.0), ("level", None)]:
        # From where to where each coordinate goes, without the sag.
        start = [-m.of_force * GRAVITY * grams if grams else m.of_load * MASS * GRAVITY for m in modes]
        rows = []
        for row in range(121):
            t = row / 240
            z = sag(stiffness) + 10 * sum(q * m.tip * m.ringing(t) for q, m in zip(start, modes))
            rows.append([f"{t:.5f}", f"{z + noise.gauss(0, NOISE_MM):.3f}"])
        write(HERE / f"released/{name}.csv", ["t_s", "tip_z_mm"], rows)


def dropped():
    """Flat robots dropped on a floor that returns 0.45 of their speed, down to 2 mm/s."""
    noise = random.Random(7)
    for height in [4, 6, 9, 13, 16, 20]:
        # Speeds at the floor, and when it is left.
        speed = math.sqrt(2 * 10 * GRAVITY * height)
        left, speeds = [speed / (10 * GRAVITY)], [0.45 * speed]
        while speeds[-1] > 2:
            left.append(left[-1] + 2 * speeds[-1] / (10 * GRAVITY))
            speeds.append(0.45 * speeds[-1])
        rows = []
        for row in range(80):
            t = row / 400
            flights = [(t - at, speed) for at, speed in zip(left, speeds) if at <= t]
            since, speed = flights[-1] if flights else (t, 0)
            z = (0 if flights else height) + speed * since - 5 * GRAVITY * since**2
            rows.append([f"{t:.4f}", f"{max(z, 0) + noise.gauss(0, NOISE_MM):.3f}"])
        write(HERE / f"dropped/{height}mm.csv", ["t_s", "middle_z_mm"], rows)


def exposure():
    """Sines filmed at 60 frames a second with an exposure of 16 ms; nothing is hidden. The voltage is logged at 250 Hz."""
    noise = random.Random(2)
    modes = [Mode(i + 1) for i in range(6)]
    for frequency in [3, 8, 13, 17]:
        volt = lambda t: 50 * (1 - math.cos(2 * math.pi * frequency * t))
        rows = [[f"{k / 250:.3f}", f"{volt(k / 250):.3f}"] for k in range(271)]
        write(HERE / f"exposure/{frequency}hz-volts.csv", ["t_s", "v1_v"], rows)
        rows = []
        for frame in range(1, 61):
            z = sag() + 10 * sum(100 * m.of_volt * m.tip * m.driven(frequency, frame / 60, 0.016) for m in modes)
            rows.append([frame, f"{z + noise.gauss(0, 0.04):.3f}"])
        write(HERE / f"exposure/{frequency}hz-camera.csv", ["frame", "tip_z_mm"], rows)


def frequency_response():
    """Frequency responses of a sheet of 1.5 times the damping."""
    noise = random.Random(3)
    modes = [Mode(i + 1, damping=1.5) for i in range(6)]
    for volts in [10, 20, 30]:
        rows = []
        for k in range(26):
            f = 2 * 1.12**k
            z = 10 * sum(volts * m.of_volt * m.tip * m.response(f) for m in modes)
            z += complex(noise.gauss(0, 0.01), noise.gauss(0, 0.01))
            rows.append([f"{f:.3f}", f"{abs(z):.5f}", f"{math.degrees(cmath.phase(z)):.3f}"])
        write(HERE / f"frequency_response/{volts}v.csv", ["f_hz", "amplitude_mm", "phase_deg"], rows)


def slow_loops():
    """Voltages and heights without time. Each of eight plays (backlash) follows the voltage within its width."""
    noise = random.Random(4)
    for most in [1000, 600, 300]:
        plays, rows = [0.0] * 8, []
        for v in [*range(0, most, 20), *range(most, -1, -20)]:
            # Widths up to 400 V; six tenths of the motion are without play.
            plays = [min(max(p, v - 50 * (i + 1)), v + 50 * (i + 1)) for i, p in enumerate(plays)]
            bend = CURVATURE * (0.6 * v + 0.4 * sum(plays) / len(plays))
            height = (1 - math.cos(bend * LENGTH)) / bend if bend else 0.0
            rows.append([v, f"{sag() + 10 * height + noise.gauss(0, NOISE_MM):.3f}"])
        write(HERE / f"slow_loops/{most}v.csv", ["v1_v", "tip_z_mm"], rows)


if __name__ == "__main__":
    two_clocks()
    one_point()
    released()
    dropped()
    exposure()
    frequency_response()
    slow_loops()
