//! Domains keep switching slowly after a change of voltage.
//!
//! ```text
//! θ_V = −γ·ℓ·(V + Σ w_j q_j),  q̇_j = (V·|V/1 kV|^e − q_j)/T_j,  T_j = T_0·10^(j/r),  w_j = c/r·(T_j/1 s)^p,  T_j ≤ T_max
//! ```
//!
//! The elements are a Kelvin-Voigt chain. T_max is three times the run's length unless it is given, so runs of different lengths have the same
//! elements only where it is; a run that continues from a saved state keeps the elements of that state. A diagnosis gives all runs of a data set three times
//! the longest one's length: elements that only some runs have would differ by their part of the first voltage, which they hold from before the run.
//!
//! With p = 0 the response to a step grows by the share c per decade of time beyond T_0, with another p by a power law of time. r is the number of elements per
//! decade; r = 0 is a single element of the weight c. With e > 0 creep grows faster than the voltage, as domains switch more readily near the coercive field.
//! With R > 0 the rate is an activated one, q̇_j = R/T_j·sinh((V·|V/1 kV|^e − q_j)/R): what is far behind follows far sooner, so that one element grows with the logarithm
//! of time until it is within R. (tanh of half the distance over R falls as exp(−t/T_j), exactly.)
//!
//! # Parameters
//! * `per_decade` (1/decade): growth c of the step response in the decade about 1 s, as a share of the immediate response
//! * `power` (–): exponent p
//! * `rungs_per_decade` (–): r; 0 is a single element of the weight c
//! * `fastest_s` (s): time constant T_0 of the first element
//! * `slowest_s` (s): largest time constant T_max; 0 is three times the run's length
//! * `voltage_exponent` (–): exponent e with which creep grows faster than the voltage
//! * `activation_v` (V): R, the distance from which on an activated rate grows exponentially; 0 is a rate in proportion to the distance
//!
//! # Source
//! Physik Instrumente, piezo tutorial; creep of soft PZT (power law, larger near the coercive field) and of LIPCA benders: Beck et al.; lag and power of the voltage derived. Activated rate: H. Eyring, J. Chem. Phys. 4 (1936) 283.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, SignalStage, fits};

/// See the file's head.
pub const CREEP: Effect = Effect {
    id: "creep",
    kind: Kind::Actuation,
    cause: "Domains keep switching slowly after a change of voltage.",
    equation: "θ_V = −γ·ℓ·(V + Σ w_j q_j),  q̇_j = (V·|V/1 kV|^e − q_j)/T_j,  T_j = T_0·10^(j/r),  w_j = c/r·(T_j/1 s)^p",
    source: "Physik Instrumente, piezo tutorial; creep of soft PZT (power law, larger near the coercive field) and of LIPCA benders: Beck et al.; lag and power of the voltage derived. Activated rate: H. Eyring, J. Chem. Phys. 4 (1936) 283.",
    parameters: &[
        Parameter {
            name: "per_decade",
            unit: "1/decade",
            bounds: [0.0, 1.0],
            off: Some(0.0),
            default: None,
            about: "growth c of the step response in the decade about 1 s, as a share of the immediate response",
        },
        Parameter { name: "power", unit: "", bounds: [-1.0, 1.0], off: None, default: Some(0.0), about: "exponent p" },
        Parameter {
            name: "rungs_per_decade",
            unit: "",
            bounds: [0.0, 4.0],
            off: None,
            default: Some(1.0),
            about: "r; 0 is a single element of the weight c",
        },
        Parameter {
            name: "fastest_s",
            unit: "s",
            bounds: [0.01, 100.0],
            off: None,
            default: Some(0.1),
            about: "time constant T_0 of the first element",
        },
        Parameter {
            name: "slowest_s",
            unit: "s",
            bounds: [0.0, 1e9],
            off: None,
            default: Some(0.0),
            about: "largest time constant T_max; 0 is three times the run's length",
        },
        Parameter {
            name: "voltage_exponent",
            unit: "",
            bounds: [0.0, 3.0],
            off: None,
            default: Some(0.0),
            about: "exponent e with which creep grows faster than the voltage",
        },
        Parameter {
            name: "activation_v",
            unit: "V",
            bounds: [0.0, 1e6],
            off: None,
            default: Some(0.0),
            about: "R, the distance from which on an activated rate grows exponentially; 0 is a rate in proportion to the distance",
        },
    ],
    places: &[Place::VoltageMemory],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[
            Form {
                fitted: &[("per_decade", 0.02), ("power", 0.2), ("fastest_s", 0.3)],
                starts: &[&[0.02, 0.0, 0.3], &[0.02, 0.0, 3.0]],
                given: &[("rungs_per_decade", 2.0)],
            },
            Form {
                fitted: &[("per_decade", 0.02), ("power", 0.2), ("voltage_exponent", 0.3)],
                starts: &[&[0.02, 0.0, 0.7]],
                given: &[("rungs_per_decade", 2.0)],
            },
            Form {
                fitted: &[("per_decade", 0.02), ("fastest_s", 0.3), ("activation_v", 100.0)],
                starts: &[&[0.02, 3.0, 300.0]],
                given: &[("rungs_per_decade", 0.0)],
            },
        ],
        forms: &[
            Form {
                fitted: &[("per_decade", 0.02), ("power", 0.2)],
                starts: &[&[0.02, 0.0]],
                given: &[("rungs_per_decade", 1.0)],
            },
            Form {
                fitted: &[("per_decade", 0.02), ("power", 0.2)],
                starts: &[&[0.02, 0.0]],
                given: &[("rungs_per_decade", 2.0)],
            },
            Form {
                fitted: &[("per_decade", 0.02), ("power", 0.2)],
                starts: &[&[0.02, 0.0]],
                given: &[("rungs_per_decade", 1.0), ("fastest_s", 0.01)],
            },
            Form {
                fitted: &[("per_decade", 0.02), ("fastest_s", 0.3)],
                starts: &[&[0.02, 0.3], &[0.02, 3.0]],
                given: &[("rungs_per_decade", 0.0)],
            },
        ],
    },
    shape: None,
    action: Action::Voltages(|p, n, duration| {
        let chain = Chain { growth: p[0], power: p[1], per_decade: p[2], fastest: p[3] };
        let elements = chain.up_to(if p[4] > 0.0 { p[4] } else { 3.0 * duration });
        Box::new(Creep {
            behind: vec![vec![0.0; n]; elements.len()],
            elements,
            exponent: p[5],
            activation: p[6],
            chain,
            actuators: n,
        })
    }),
};

/// Parameters of the elements, in the equation's symbols.
#[derive(Debug, Clone, Copy)]
struct Chain {
    /// c.
    growth: f64,
    /// p.
    power: f64,
    /// r.
    per_decade: f64,
    /// T_0 (s).
    fastest: f64,
}

impl Chain {
    /// T_j (s).
    fn time(&self, element: usize) -> f64 {
        self.fastest * 10_f64.powf(element as f64 / self.per_decade)
    }

    /// T_j (s) and w_j of the first `count` elements.
    fn elements(&self, count: usize) -> Vec<[f64; 2]> {
        if self.per_decade == 0.0 {
            return vec![[self.fastest, self.growth]];
        }
        let element = |element| [self.time(element), self.growth / self.per_decade * self.time(element).powf(self.power)];
        (0..count).map(element).collect()
    }

    /// T_j (s) and w_j of the elements with T_j up to `slowest` (s), at least the first.
    fn up_to(&self, slowest: f64) -> Vec<[f64; 2]> {
        let others = if self.per_decade == 0.0 { 0 } else { (1..).take_while(|element| self.time(*element) <= slowest).count() };
        self.elements(1 + others)
    }
}

struct Creep {
    /// T_j (s) and w_j.
    elements: Vec<[f64; 2]>,
    /// q_j (V), elements × actuators.
    behind: Vec<Vec<f64>>,
    /// e.
    exponent: f64,
    /// R (V).
    activation: f64,
    chain: Chain,
    actuators: usize,
}

impl Creep {
    /// What the elements follow (V).
    fn aim(&self, volts: f64) -> f64 {
        if self.exponent == 0.0 { volts } else { volts * (volts / 1000.0).abs().powf(self.exponent) }
    }
}

/// Most elements in a saved state: four in each of 50 decades.
const MOST_ELEMENTS: f64 = 200.0;

/// The mean distance (V) over a number of time constants, and what is left in the end, of a distance `away` (V), with an activation R (V).
fn relaxed(activation: f64, away: f64, constants: f64) -> [f64; 2] {
    if activation == 0.0 {
        let gone = -(-constants).exp_m1();
        return [away * gone / constants, away * (1.0 - gone)];
    }
    // tanh x = (1 − w)/(1 + w) with w = exp(−2 x); 1 − tanh x of the end from that of the beginning, without cancellation far away.
    let w = (-(away / activation).abs()).exp();
    let left = |constants: f64| {
        let (still, gone) = ((-constants).exp(), -(-constants).exp_m1());
        let part = still * (1.0 - w) / (1.0 + w);
        (activation * ((1.0 + part) / (gone + still * 2.0 * w / (1.0 + w))).ln()).copysign(away)
    };
    let end = left(constants);
    // By Simpson's rule: in the very step of a jump too much, by less than a sixth of the jump.
    [(away + 4.0 * left(0.5 * constants) + end) / 6.0, end]
}

impl SignalStage for Creep {
    /// All creep has happened at rest: q_j = V·|V/1 kV|^e.
    fn settle(&mut self, volts: &mut [f64]) {
        let whole: f64 = self.elements.iter().map(|[_, weight]| weight).sum();
        for (i, volts) in volts.iter_mut().enumerate() {
            let aim = self.aim(*volts);
            self.behind.iter_mut().for_each(|q| q[i] = aim);
            *volts += whole * aim;
        }
    }

    fn pass(&mut self, dt: f64, volts: &mut [f64]) {
        for (i, volts) in volts.iter_mut().enumerate() {
            let (mut crept, aim) = (0.0, self.aim(*volts));
            for ([time, weight], q) in self.elements.iter().zip(&mut self.behind) {
                let [mean, left] = relaxed(self.activation, q[i] - aim, dt / time);
                crept += weight * (aim + mean);
                q[i] = aim + left;
            }
            *volts += crept;
        }
    }

    /// The number of elements, then all q_j.
    fn memory(&self) -> Vec<f64> {
        std::iter::once(self.elements.len() as f64).chain(self.behind.iter().flatten().copied()).collect()
    }

    fn held(&self, saved: &[f64]) -> Option<usize> {
        let count = *saved.first()?;
        let fits =
            count.fract() == 0.0 && (1.0..=MOST_ELEMENTS).contains(&count) && (count == 1.0 || self.chain.per_decade > 0.0);
        let held = 1 + count as usize * self.actuators;
        (fits && held <= saved.len()).then_some(held)
    }

    fn remember(&mut self, memory: &[f64]) {
        let [count, behind @ ..] = memory else { return };
        self.elements = self.chain.elements(*count as usize);
        self.behind = behind.chunks_exact(self.actuators).map(<[f64]>::to_vec).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_grows_by_the_same_amount_in_every_decade() {
        let Action::Voltages(make) = CREEP.action else { unreachable!() };
        let mut creep = make(&[0.02, 0.0, 1.0, 0.1, 0.0, 0.0, 0.0], 1, 100.0);
        creep.settle(&mut [0.0]);
        let (dt, mut at) = (1e-3, Vec::new());
        for step in 1..=30_000 {
            let mut volts = [1000.0];
            creep.pass(dt, &mut volts);
            if [300, 3_000, 30_000].contains(&step) {
                at.push(volts[0]);
            }
        }
        // 0.02 of 1000 V per decade; a chain of one element per decade ripples by a few per cent.
        for pair in at.windows(2) {
            assert!((pair[1] - pair[0] - 20.0).abs() < 1.0, "{at:?}");
        }
    }

    #[test]
    fn finer_elements_grow_alike_and_a_power_of_time_grows_as_such() {
        let Action::Voltages(make) = CREEP.action else { unreachable!() };
        let at = |values: &[f64], times: &[usize]| {
            // Elements up to 3·10⁵ s: what lies beyond takes 20·log₁₀e·t/3·10⁵ s, 10⁻³ of the growth at 30 s.
            let mut creep = make(values, 1, 1e5);
            creep.settle(&mut [0.0]);
            let mut found = Vec::new();
            for step in 1..=30_000 {
                let mut volts = [1000.0];
                creep.pass(1e-3, &mut volts);
                if times.contains(&step) {
                    found.push(volts[0] - 1000.0);
                }
            }
            found
        };
        let fine = at(&[0.02, 0.0, 4.0, 0.01, 0.0, 0.0, 0.0], &[300, 3_000, 30_000]);
        // Four elements a decade: no ripple to speak of.
        assert!(fine.windows(2).all(|pair| (pair[1] - pair[0] - 20.0).abs() < 0.02), "{fine:?}");
        // w = c/r·T^p over elements that are dense in log T: c·Γ(1 − p)/(p ln 10)·t^p but for a constant.
        let power = at(&[0.02, 0.3, 4.0, 0.01, 0.0, 0.0, 0.0], &[300, 3_000, 30_000]);
        let ratio = (power[2] - power[1]) / (power[1] - power[0]);
        assert!((ratio / 10_f64.powf(0.3) - 1.0).abs() < 0.01, "{power:?}");
        // One element: 1 − exp(−t/T).
        let single = at(&[0.02, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0], &[2_000]);
        assert!((single[0] - 20.0 * -(-1.0_f64).exp_m1()).abs() < 0.01, "{single:?}");
    }

    #[test]
    fn creep_with_an_exponent_grows_faster_than_the_voltage_and_is_odd() {
        let Action::Voltages(make) = CREEP.action else { unreachable!() };
        let crept = |exponent: f64, step: f64| {
            let mut creep = make(&[0.02, 0.0, 1.0, 0.1, 0.0, exponent, 0.0], 1, 100.0);
            creep.settle(&mut [0.0]);
            let mut volts = [0.0];
            for _ in 0..3_000 {
                volts = [step];
                creep.pass(1e-3, &mut volts);
            }
            volts[0] - step
        };
        // Of a step of 1 kV it is the same for all exponents; of a half of it (1/2)^(1 + e) as much.
        for exponent in [0.0, 0.7, 2.0] {
            assert!((crept(exponent, 1000.0) / crept(0.0, 1000.0) - 1.0).abs() < 1e-12);
            let ratio = crept(exponent, -500.0) / crept(exponent, 1000.0);
            assert!((ratio + 0.5_f64.powf(1.0 + exponent)).abs() < 1e-12, "{exponent}: {ratio}");
        }
        // At rest all of it has happened.
        let (mut creep, mut settled, mut later) = (make(&[0.02, 0.0, 1.0, 0.1, 0.0, 1.0, 0.0], 1, 100.0), [500.0], [500.0]);
        creep.settle(&mut settled);
        creep.pass(1e-3, &mut later);
        assert!((settled[0] - later[0]).abs() < 1e-9 && settled[0] > 500.0, "{settled:?} {later:?}");
    }

    #[test]
    fn an_activated_rate_follows_its_equation_and_grows_with_the_logarithm_of_time() {
        let Action::Voltages(make) = CREEP.action else { unreachable!() };
        let (weight, time, activation, step) = (0.05, 10.0, 50.0, 1000.0);
        let crept = |dt: f64, until: f64| {
            let mut creep = make(&[weight, 0.0, 0.0, time, 0.0, 0.0, activation], 1, 100.0);
            creep.settle(&mut [0.0]);
            (0..(until / dt).round() as usize).for_each(|_| creep.pass(dt, &mut [step]));
            creep.memory()[1]
        };
        // The equation itself, by Runge and Kutta's method of fourth order, where it is not stiff: from 1 s on.
        let rate = |q: f64| activation / time * ((step - q) / activation).sinh();
        let (mut q, h) = (crept(1e-3, 1.0), 1e-4);
        for _ in 0..20_000 {
            let a = rate(q);
            let b = rate(q + 0.5 * h * a);
            let c = rate(q + 0.5 * h * b);
            q += h / 6.0 * (a + 2.0 * b + 2.0 * c + rate(q + h * c));
        }
        assert!((crept(1e-3, 3.0) - q).abs() < 1e-6, "{} {q}", crept(1e-3, 3.0));
        // Steps of any length do the same; far away, q grows by R ln 10 in a decade; in the end nothing is left.
        assert!((crept(1e-3, 3.0) - crept(0.5, 3.0)).abs() < 1e-9);
        let decade = crept(1e-4, 0.1) - crept(1e-4, 0.01);
        assert!((decade / (activation * 10_f64.ln()) - 1.0).abs() < 0.01, "{decade}");
        assert!((crept(1.0, 300.0) - step).abs() < 1e-6);
        // What is passed on is the mean over a step: of many small ones as of one that is not stiff.
        let passed = |steps: usize| {
            let mut creep = make(&[weight, 0.0, 0.0, time, 0.0, 0.0, activation], 1, 100.0);
            creep.settle(&mut [0.0]);
            (0..1000).for_each(|_| creep.pass(1e-3, &mut [step]));
            let all = (0..steps).map(|_| {
                let mut volts = [step];
                creep.pass(0.2 / steps as f64, &mut volts);
                volts[0]
            });
            all.sum::<f64>() / steps as f64
        };
        assert!((passed(1) - passed(200)).abs() < 1e-3, "{} {}", passed(1), passed(200));
        // Nearly in proportion to the distance where that is small.
        let mut creep = make(&[weight, 0.0, 0.0, time, 0.0, 0.0, 1e5], 1, 100.0);
        creep.settle(&mut [0.0]);
        creep.pass(5.0, &mut [-100.0]);
        assert!((creep.memory()[1] + 100.0 * -(-0.5_f64).exp_m1()).abs() < 1e-4, "{:?}", creep.memory());
    }
}
