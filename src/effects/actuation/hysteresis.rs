//! Domains in the ceramic switch with memory, so the strain lags the voltage at any rate.
//!
//! ```text
//! θ_V = −γ·ℓ·g·(V − h),    ḣ = A·V̇ − b·|V̇|·|h|^(n−1)·h − c·V̇·|h|^n,    h_max = (A/(b + c))^(1/n)          (Bouc-Wen)
//!                        h = Σ w_i (V − p_i),    p_i ← max(V − r_i, min(V + r_i, p_i))                    (Prandtl-Ishlinskii)
//! ```
//!
//! Both are independent of rate. `width` is the opening of the loop as a share of a 1500 V stroke.
//!
//! Bouc-Wen: the opening is 2·h_max, so h_max = 750 V · width; b and c follow from A, h_max and the asymmetry c/b.
//!
//! Prandtl-Ishlinskii (`plays = 1`): sixteen radii in geometric series from 30 to 1400 V with weights r^shape·exp(−decay·r), scaled so that the loop
//! between 0 and 1500 V opens by 1500 V · width at its middle. The plays start at rest at the first voltage, or (`from_zero = 1`) have come to it
//! from 0 V.
//!
//! g is a convention: `gain`, or (`pinned = 1`) the one with which a steady loop between 0 and 1500 V has the secant 1, so that the gain over a full
//! stroke is left to `actuation-gain`.
//!
//! # Parameters
//! * `width` (–): opening of the loop as a share of a 1500 V stroke
//! * `slope_loss` (–): A: loss of gain at a turning point (Bouc-Wen)
//! * `asymmetry` (–): c/b (Bouc-Wen)
//! * `exponent` (–): n (Bouc-Wen)
//! * `plays` (–): 0: Bouc-Wen; 1: Prandtl-Ishlinskii, with width, shape, decay_per_kv and from_zero
//! * `shape` (–): exponent of the radius in the plays' weights (Prandtl-Ishlinskii)
//! * `gain` (–): gain g of the loop
//! * `from_zero` (–): 1: the plays have come to the first voltage from 0 V; 0: they start at rest there (Prandtl-Ishlinskii)
//! * `decay_per_kv` (1/kV): exponential decay of the plays' weights with the radius (Prandtl-Ishlinskii)
//! * `pinned` (–): 1: the gain follows from the loop, so that a full stroke of 1500 V is as long with it as without; 0: it is gain
//!
//! # Source
//! Data sheet of the MFC actuator (width about 0.2); asymmetric loops: Fu et al., Sens. Actuators A 346 (2022) 113830.

use crate::effects::{Action, Applied, Effect, Fitting, Form, Kind, Parameter, Place, SignalStage, fits};

/// See the file's head.
pub const HYSTERESIS: Effect = Effect {
    id: "hysteresis",
    kind: Kind::Actuation,
    cause: "Domains in the ceramic switch with memory, so the strain lags the voltage at any rate.",
    equation: "θ_V = −γ·ℓ·g·(V − h),  ḣ = A·V̇ − b·|V̇|·|h|^(n−1)·h − c·V̇·|h|^n",
    source: "Data sheet of the MFC actuator (width about 0.2); asymmetric loops: Fu et al., Sens. Actuators A 346 (2022) 113830.",
    parameters: &[
        Parameter {
            name: "width",
            unit: "",
            bounds: [0.0, 0.6],
            off: Some(0.0),
            default: None,
            about: "opening of the loop as a share of a 1500 V stroke",
        },
        Parameter {
            name: "slope_loss",
            unit: "",
            bounds: [0.05, 1.0],
            off: None,
            default: Some(0.5),
            about: "A: loss of gain at a turning point (Bouc-Wen)",
        },
        Parameter { name: "asymmetry", unit: "", bounds: [-0.9, 1.0], off: None, default: Some(0.0), about: "c/b (Bouc-Wen)" },
        Parameter { name: "exponent", unit: "", bounds: [1.0, 2.0], off: None, default: Some(1.0), about: "n (Bouc-Wen)" },
        Parameter {
            name: "plays",
            unit: "",
            bounds: [0.0, 1.0],
            off: None,
            default: Some(0.0),
            about: "0: Bouc-Wen; 1: Prandtl-Ishlinskii, with width, shape, decay_per_kv and from_zero",
        },
        Parameter {
            name: "shape",
            unit: "",
            bounds: [-2.0, 2.0],
            off: None,
            default: Some(0.0),
            about: "exponent of the radius in the plays' weights (Prandtl-Ishlinskii)",
        },
        Parameter { name: "gain", unit: "", bounds: [0.5, 2.0], off: None, default: Some(1.0), about: "gain g of the loop" },
        Parameter {
            name: "from_zero",
            unit: "",
            bounds: [0.0, 1.0],
            off: None,
            default: Some(0.0),
            about: "1: the plays have come to the first voltage from 0 V; 0: they start at rest there (Prandtl-Ishlinskii)",
        },
        Parameter {
            name: "decay_per_kv",
            unit: "1/kV",
            bounds: [0.0, 20.0],
            off: None,
            default: Some(0.0),
            about: "exponential decay of the plays' weights with the radius (Prandtl-Ishlinskii)",
        },
        Parameter {
            name: "pinned",
            unit: "",
            bounds: [0.0, 1.0],
            off: None,
            default: Some(0.0),
            about: "1: the gain follows from the loop, so that a full stroke of 1500 V is as long with it as without; 0: it is gain",
        },
    ],
    places: &[Place::VoltageMemory],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[],
        forms: &[
            Form {
                fitted: &[("width", 0.05), ("slope_loss", 0.2), ("asymmetry", 0.3)],
                starts: &[&[0.05, 0.2, 0.0], &[0.2, 0.6, 0.0]],
                given: &[("exponent", 1.0), ("plays", 0.0), ("pinned", 1.0)],
            },
            Form {
                fitted: &[("width", 0.05), ("shape", 0.5), ("decay_per_kv", 2.0)],
                starts: &[&[0.05, 0.0, 1.0], &[0.2, 0.5, 1.0]],
                given: &[("plays", 1.0), ("from_zero", 0.0), ("pinned", 1.0)],
            },
            Form {
                fitted: &[("width", 0.05), ("shape", 0.5), ("decay_per_kv", 2.0)],
                starts: &[&[0.05, 0.0, 1.0]],
                given: &[("plays", 1.0), ("from_zero", 1.0), ("pinned", 1.0)],
            },
        ],
    },
    shape: None,
    action: Action::Voltages(|p, n, _| if p[4] < 0.5 { Box::new(BoucWen::new(p, n)) } else { Box::new(Plays::new(p, n)) }),
};

/// Stroke to which the width refers (V).
const STROKE: f64 = 1500.0;
/// Steps towards the gain of a pinned loop.
const PINNING_STEPS: usize = 6;
/// Largest change of the state in a substep, as a share of its limit.
const LARGEST_PART: f64 = 0.05;

/// Slopes between the ends of the first stroke of 1500 V from rest at 0 V, and of a steady one.
pub(crate) fn secants(hysteresis: &Applied) -> [f64; 2] {
    let Action::Voltages(stage) = HYSTERESIS.action else { return [1.0; 2] };
    secants_of(&mut *stage(&hysteresis.values, 1, 0.0))
}

/// The same of a stage; its second loop is taken for steady.
fn secants_of(stage: &mut dyn SignalStage) -> [f64; 2] {
    stage.settle(&mut [0.0]);
    let [first, _, high, low] = [STROKE, 0.0, STROKE, 0.0].map(|volts| {
        let mut out = [volts];
        stage.pass(0.0, &mut out);
        out[0]
    });
    [first / STROKE, (high - low) / STROKE]
}

struct BoucWen {
    /// A.
    slope: f64,
    /// b and c times h_max^n, so that the state is a share of h_max.
    b: f64,
    c: f64,
    /// n.
    exponent: f64,
    /// h_max (V).
    limit: f64,
    /// g.
    gain: f64,
    /// V of every actuator (V).
    volts: Vec<f64>,
    /// h/h_max of every actuator.
    state: Vec<f64>,
}

impl BoucWen {
    fn new(p: &[f64], actuators: usize) -> Self {
        let mut gain = if p[9] < 0.5 { p[6] } else { 1.0 };
        // The secant changes little with the gain, so this converges in some steps.
        for _ in 0..if p[9] < 0.5 { 0 } else { PINNING_STEPS } {
            gain /= secants_of(&mut Self::with_gain(p, gain, 1))[1];
        }
        Self::with_gain(p, gain, actuators)
    }

    fn with_gain(p: &[f64], gain: f64, actuators: usize) -> Self {
        let b = p[1] / (1.0 + p[2]);
        Self {
            slope: p[1],
            b,
            c: p[2] * b,
            exponent: p[3],
            limit: 0.5 * STROKE * p[0] / gain,
            gain,
            volts: vec![0.0; actuators],
            state: vec![0.0; actuators],
        }
    }

    /// dh/dV at the state `h` for a voltage that changes in the direction `sign`.
    fn rate(&self, h: f64, sign: f64) -> f64 {
        let power = h.abs().powf(self.exponent);
        self.slope - self.b * sign * power.copysign(h) - self.c * power
    }
}

impl SignalStage for BoucWen {
    fn settle(&mut self, volts: &mut [f64]) {
        self.volts.copy_from_slice(volts);
        self.state.fill(0.0);
        volts.iter_mut().for_each(|v| *v *= self.gain);
    }

    fn pass(&mut self, _dt: f64, volts: &mut [f64]) {
        for (i, volts) in volts.iter_mut().enumerate() {
            let change = (*volts - self.volts[i]) / self.limit;
            self.volts[i] = *volts;
            let parts = (change.abs() * self.slope / LARGEST_PART).ceil();
            let (by, sign) = (change / parts, change.signum());
            let mut h = self.state[i];
            // Midpoint rule, of second order.
            for _ in 0..parts as u64 {
                let half = h + 0.5 * by * self.rate(h, sign);
                let next = h + by * self.rate(half, sign);
                // The limit, which takes some 40/LARGEST_PART parts to reach, however far the voltage goes.
                if next == h {
                    break;
                }
                h = next;
            }
            self.state[i] = h;
            *volts = self.gain * (*volts - self.limit * h);
        }
    }

    fn memory(&self) -> Vec<f64> {
        [self.volts.as_slice(), &self.state].concat()
    }

    fn remember(&mut self, memory: &[f64]) {
        let (volts, state) = memory.split_at(self.volts.len());
        self.volts.copy_from_slice(volts);
        self.state.copy_from_slice(state);
    }
}

/// Number of plays.
const RADII: usize = 16;

/// Radius of play `i` (V).
fn radius(i: usize) -> f64 {
    30.0 * (1400.0_f64 / 30.0).powf(i as f64 / (RADII - 1) as f64)
}

struct Plays {
    /// w_i.
    weights: [f64; RADII],
    /// r_i (V).
    radii: [f64; RADII],
    /// g.
    gain: f64,
    from_zero: bool,
    /// p_i (V), actuators × plays.
    plays: Vec<f64>,
}

impl Plays {
    fn new(p: &[f64], actuators: usize) -> Self {
        let (width, shape, decay) = (p[0], p[5], 1e-3 * p[8]);
        let radii = std::array::from_fn(radius);
        let raw: [f64; RADII] = radii.map(|r: f64| r.powf(shape) * (-decay * r).exp());
        // Half way through a stroke of S between turning points, the branches of a play of radius r are min(2 r, S − 2 r) apart, or not at all.
        let opening: f64 = raw.iter().zip(&radii).map(|(w, r)| w * (2.0 * r).min(STROKE - 2.0 * r).max(0.0)).sum();
        let scale = width * STROKE / opening;
        // A play of radius r follows all of a stroke S but 2 r.
        let lost: f64 = raw.iter().zip(&radii).map(|(w, r)| scale * w * (2.0 * r / STROKE).min(1.0)).sum();
        let gain = if p[9] < 0.5 { p[6] } else { 1.0 + lost };
        Self { weights: raw.map(|w| scale * w / gain), radii, gain, from_zero: p[7] > 0.5, plays: vec![0.0; RADII * actuators] }
    }
}

impl SignalStage for Plays {
    fn settle(&mut self, volts: &mut [f64]) {
        for (plays, volts) in self.plays.chunks_exact_mut(RADII).zip(&*volts) {
            plays.fill(if self.from_zero { 0.0 } else { *volts });
        }
        self.pass(0.0, volts);
    }

    fn pass(&mut self, _dt: f64, volts: &mut [f64]) {
        for (plays, volts) in self.plays.chunks_exact_mut(RADII).zip(volts) {
            let mut h = 0.0;
            for ((play, weight), radius) in plays.iter_mut().zip(&self.weights).zip(&self.radii) {
                *play = play.max(*volts - radius).min(*volts + radius);
                h += weight * (*volts - *play);
            }
            *volts = self.gain * (*volts - h);
        }
    }

    fn memory(&self) -> Vec<f64> {
        self.plays.clone()
    }

    fn remember(&mut self, memory: &[f64]) {
        self.plays.copy_from_slice(memory);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Opening of the loop between 0 and −1500 V at its middle (V), in steps of `step` volts.
    fn opening(hysteresis: &mut dyn SignalStage, step: f64) -> f64 {
        let steps = (1500.0 / step) as usize;
        hysteresis.settle(&mut [0.0]);
        let mut middle = [0.0; 2];
        for _ in 0..3 {
            for (branch, middle) in middle.iter_mut().enumerate() {
                for k in 1..=steps {
                    let volts = step * k as f64;
                    let mut out = [if branch == 0 { -volts } else { volts - 1500.0 }];
                    hysteresis.pass(1.0, &mut out);
                    if 2 * k == steps {
                        *middle = out[0];
                    }
                }
            }
        }
        middle[0] - middle[1]
    }

    #[test]
    fn the_opening_of_the_loop_is_the_width_at_any_rate() {
        for step in [1.0, 15.0] {
            // With a steep slope the Bouc-Wen state is at its limit half way.
            let bouc_wen = opening(&mut BoucWen::new(&[0.1, 1.0, 0.0, 1.0, 0.0, 0.0, 1.3, 0.0, 0.0, 0.0], 1), step);
            assert!((bouc_wen / 150.0 - 1.0).abs() < 1e-3, "{bouc_wen}");
        }
        let plays = opening(&mut Plays::new(&[0.1, 0.0, 0.0, 1.0, 1.0, 0.5, 1.3, 0.0, 1.0, 0.0], 1), 15.0);
        assert!((plays / 150.0 - 1.0).abs() < 1e-9, "{plays}");
    }

    /// The change of voltage over the limit decides the number of parts, 10⁹ to 10³⁰⁰ here.
    #[test]
    fn a_narrow_loop_or_a_huge_voltage_takes_no_longer_and_ends_at_the_limit() {
        for exponent in [1.0, 1.5, 2.0] {
            for asymmetry in [-0.9, 0.0, 1.0] {
                for (width, volts) in [(1e-9, 1500.0), (1e-300, 1.0), (0.2, 1e10), (0.2, 1e300)] {
                    let mut hysteresis = BoucWen::new(&[width, 0.5, asymmetry, exponent, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 1);
                    let start = std::time::Instant::now();
                    hysteresis.settle(&mut [0.0]);
                    for sign in [1.0, -1.0, 1.0] {
                        hysteresis.pass(1e-4, &mut [sign * volts]);
                        assert!((hysteresis.state[0] - sign).abs() < 1e-14, "{width} {volts}: {}", hysteresis.state[0]);
                    }
                    assert!(start.elapsed().as_millis() < 200, "{width} {volts}: {:?}", start.elapsed());
                }
            }
        }
    }

    #[test]
    fn a_pinned_loop_passes_a_full_stroke_unchanged() {
        let range = |hysteresis: &mut dyn SignalStage| {
            hysteresis.settle(&mut [0.0]);
            let mut ends = [0.0; 2];
            for _ in 0..3 {
                for (end, volts) in ends.iter_mut().zip([-1500.0, 0.0]) {
                    let mut out = [volts];
                    hysteresis.pass(1.0, &mut out);
                    *end = out[0];
                }
            }
            ends[1] - ends[0]
        };
        for (width, slope, asymmetry) in [(0.1, 0.5, 0.0), (0.4, 1.0, 0.3), (0.05, 0.2, -0.5)] {
            let bouc_wen = range(&mut BoucWen::new(&[width, slope, asymmetry, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0], 1));
            // A loop that is not symmetric differs between the two directions of the stroke.
            let limit = if asymmetry == 0.0 { 1e-6 } else { 0.02 };
            assert!((bouc_wen / 1500.0 - 1.0).abs() < limit, "{width} {slope}: {bouc_wen}");
        }
        for decay in [0.0, 5.0] {
            let plays = range(&mut Plays::new(&[0.2, 0.0, 0.0, 1.0, 1.0, 0.5, 1.0, 0.0, decay, 1.0], 1));
            assert!((plays / 1500.0 - 1.0).abs() < 1e-12, "{plays}");
        }
    }

    #[test]
    fn a_minor_loop_closes() {
        let mut plays = Plays::new(&[0.2, 0.0, 0.0, 1.0, 1.0, 0.5, 1.0, 1.0, 0.0, 0.0], 1);
        plays.settle(&mut [0.0]);
        let mut at = |volts: f64| {
            let mut out = [volts];
            plays.pass(1.0, &mut out);
            out[0]
        };
        at(-1500.0);
        let before = at(-600.0);
        at(-900.0);
        assert!((at(-600.0) - before).abs() < 1e-9);
    }
}
