"""Plants of the tests: a carriage on a rail whose force is predicted from its motion, and a mass on a spring in time."""

import time

import numpy as np
from scipy.integrate import solve_ivp

from sfers_rs.plant import Candidate, Constant, Diverged, Parameter, Plant, Run

MASS, VISCOUS = 2.0, 3.0


def friction(v):
    """The sign of a speed, rounded within 5 mm/s."""
    return np.tanh(v / 0.005)


class Carriage(Plant):
    """Inverse dynamics: ``F = m a + c v``, and what may be hidden in the data.

    ``hidden`` takes x (m), v (m/s) and returns a force (N); the noise of 0.05 N has a fixed seed. Runs have (amplitude in m, frequency in Hz).
    """

    channels, unit = ["force"], "N"
    constants = [
        Constant("mass", MASS, bounds=(0.5, 8.0), unit="kg", cause="The moved mass differs."),
        Constant("viscous-friction", VISCOUS, bounds=(0.0, 20.0), unit="N·s/m"),
    ]
    candidates = [
        Candidate("dry-friction", [Parameter("force", bounds=(0.0, 10.0), unit="N")], "Friction of constant size.", "speed"),
        Candidate("drag", [Parameter("coefficient", bounds=(-20.0, 20.0), unit="N·s²/m²")], "Drag grows with v².", "speed"),
        Candidate("spring", [Parameter("stiffness", bounds=(-50.0, 50.0), unit="N/m")], "A spring acts.", "position"),
        Candidate("hardening", [Parameter("stiffness", bounds=(-500.0, 500.0), unit="N/m³")], "A spring hardens.", "position"),
    ]
    motions = [(0.1, 0.5), (0.2, 0.5), (0.3, 0.7), (0.15, 1.0), (0.25, 1.2), (0.1, 1.5), (0.2, 1.6), (0.12, 2.0)]

    def __init__(self, hidden=lambda x, v: 0.0 * x, seed=1, zeros=0.0):
        random = np.random.default_rng(seed)
        times = np.arange(0.0, 4.0, 0.01)
        self.runs = []
        for index, (amplitude, frequency) in enumerate(self.motions):
            x, v, a = self.motion(amplitude, frequency, times)
            force = MASS * a + VISCOUS * v + hidden(x, v) + 0.05 * random.standard_normal(len(times)) + zeros * random.standard_normal()
            self.runs.append(Run(f"run {index + 1}", times, force, 0.05, inputs=v, data=(amplitude, frequency)))

    @staticmethod
    def motion(amplitude, frequency, times):
        w = 2.0 * np.pi * frequency
        return amplitude * np.sin(w * times), amplitude * w * np.cos(w * times), -amplitude * w * w * np.sin(w * times)

    def predict(self, model, run):
        x, v, a = self.motion(*run.data, run.times_s)
        force = model.constants["mass"] * a + model.constants["viscous-friction"] * v
        force = force + model.effect("dry-friction", "force") * friction(v) + model.effect("drag", "coefficient") * v * abs(v)
        return force + model.effect("spring", "stiffness") * x + model.effect("hardening", "stiffness") * x**3


class Slow(Carriage):
    """One that takes its time, for interrupts."""

    def predict(self, model, run):
        time.sleep(0.05)
        return super().predict(model, run)


class ParallelCarriage(Carriage):
    """One that may be predicted in several processes."""

    parallel = True


class Oscillator(Plant):
    """``x'' + 2 ζ ω x' + ω² x + F sign(x') = f sin(...)`` in time, by the leapfrog rule; measured runs come from scipy's integrator."""

    channels, unit = ["x"], "m"
    omega, zeta = 2.0 * np.pi * 1.5, 0.05
    constants = [
        Constant("spring", 1.0, bounds=(0.5, 2.0), cause="The spring is stiffer or softer."),
        Constant("damper", 1.0, bounds=(0.1, 10.0), scale=0.2, cause="The damper is stronger or weaker."),
    ]
    candidates = [
        Candidate("dry-friction", [Parameter("deceleration", bounds=(0.0, 5.0), unit="m/s²", scale=0.05)], "Friction of constant size.", "speed"),
        Candidate("drag", [Parameter("coefficient", bounds=(0.0, 2.0), unit="1/m", scale=0.05)], "Drag grows with v².", "speed"),
        Candidate("hardening", [Parameter("per_m2", bounds=(-5.0, 5.0), unit="1/m²", scale=0.1)], "The spring hardens.", "spring"),
    ]
    forces = [(4.0, 0.4), (12.0, 0.4), (4.0, 1.0), (12.0, 1.0), (3.0, 1.5), (8.0, 1.6), (6.0, 2.2), (20.0, 2.4)]

    def __init__(self, dry=0.0, seed=1):
        random = np.random.default_rng(seed)
        times = np.arange(0.0, 6.0, 0.03)
        self.runs = []
        for index, (amplitude, frequency) in enumerate(self.forces):
            force = lambda t: amplitude * np.sin(2.0 * np.pi * frequency * t)

            def rate(t, y):
                return [y[1], force(t) - 2.0 * self.zeta * self.omega * y[1] - self.omega**2 * y[0] - dry * np.tanh(y[1] / 0.02)]

            x = solve_ivp(rate, (0.0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-8, atol=1e-9, method="LSODA").y[0]
            data = (amplitude, frequency)
            self.runs.append(Run(f"run {index + 1}", times, x + 0.003 * random.standard_normal(len(x)), 0.003, force(times), data=data))

    def predict(self, model, run):
        parts = 12 if model.fine else 6
        h = (run.times_s[1] - run.times_s[0]) / parts
        amplitude, frequency = run.data
        at = h * (np.arange(parts * len(run.times_s)) + 0.5)
        force = (amplitude * np.sin(2.0 * np.pi * frequency * at)).tolist()
        stiffness = self.omega**2 * model.constants["spring"]
        half = self.zeta * self.omega * model.constants["damper"] * h
        dry, drag = model.effect("dry-friction", "deceleration"), model.effect("drag", "coefficient")
        hardening = model.effect("hardening", "per_m2")
        x = v = 0.0
        out = []
        for row in range(len(run.times_s)):
            out.append(x)
            for f in force[row * parts : (row + 1) * parts]:
                x += 0.5 * h * v
                v = ((1.0 - half) * v + h * (f - stiffness * x * (1.0 + hardening * x * x) - drag * v * abs(v))) / (1.0 + half)
                # Dry friction stops a mass, but does not turn it round.
                v = max(v - h * dry, 0.0) if v > 0.0 else min(v + h * dry, 0.0)
                x += 0.5 * h * v
        if not abs(x) < 1e6:
            raise Diverged("it ran away")
        return np.array(out)
