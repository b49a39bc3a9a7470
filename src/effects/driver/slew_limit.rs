//! The amplifier's current limit bounds the rate of voltage.
//!
//! ```text
//! dV_a/dt = S·tanh((V_c − V_a)/(S·T));  T = 0: |dV_a/dt| ≤ S, otherwise V_a = V_c;  r·S for rising voltages
//! ```
//!
//! # Parameters
//! * `rate_v_per_s` (V/s): largest rate S
//! * `rising` (–): r: largest rate of rising voltages over that of falling ones
//! * `linear_s` (s): T: time constant of small changes
//!
//! # Source
//! Derived: S = I_max/C; tanh: the differential pair in Gray and Meyer, Analysis and Design of Analog Integrated Circuits.

use super::follower::{Follower, Law};
use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const SLEW_LIMIT: Effect = Effect {
    id: "slew-limit",
    kind: Kind::Driver,
    cause: "The amplifier's current limit bounds the rate of voltage.",
    equation: "dV_a/dt = S·tanh((V_c − V_a)/(S·T));  T = 0: |dV_a/dt| ≤ S, otherwise V_a = V_c;  r·S for rising voltages",
    source: "Derived: S = I_max/C; tanh: the differential pair in Gray and Meyer, Analysis and Design of Analog Integrated Circuits.",
    parameters: &[
        Parameter {
            name: "rate_v_per_s",
            unit: "V/s",
            bounds: [100.0, 1e9],
            off: Some(f64::INFINITY),
            default: None,
            about: "largest rate S",
        },
        Parameter {
            name: "rising",
            unit: "",
            bounds: [0.1, 10.0],
            off: None,
            default: Some(1.0),
            about: "r: largest rate of rising voltages over that of falling ones",
        },
        Parameter {
            name: "linear_s",
            unit: "s",
            bounds: [0.0, 0.1],
            off: None,
            default: Some(0.0),
            about: "T: time constant of small changes",
        },
    ],
    places: &[Place::Drive],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[
            Form {
                fitted: &[("rate_v_per_s", 2e-06), ("rising", 0.3)],
                starts: &[&[3e-06, 2.0], &[1.2e-05, 2.0], &[3e-06, 0.5], &[1.2e-05, 0.5]],
                given: &[],
            },
            Form {
                fitted: &[("rate_v_per_s", 2e-06), ("linear_s", 1e-3)],
                starts: &[&[3e-06, 5e-4], &[1.2e-05, 5e-4]],
                given: &[],
            },
        ],
        forms: &[Form {
            fitted: &[("rate_v_per_s", 2e-06)],
            starts: &[&[1.5e-06], &[3e-06], &[6e-06], &[1.2e-05], &[2.5e-05]],
            given: &[],
        }],
    },
    shape: None,
    action: Action::Voltages(|p, n, _| Box::new(Follower::new(Slew { rate: p[0], rising: p[1], linear: p[2] }, n))),
};

/// From there on tanh x is 1 in double precision.
const FAR: f64 = 20.0;
/// Distance from the commanded voltage (V) at which the applied one has arrived.
const ARRIVED: f64 = 1e-3;

/// The state is the voltage in the middle of the last step.
struct Slew {
    /// S (V/s).
    rate: f64,
    /// r.
    rising: f64,
    /// T (s).
    linear: f64,
}

impl Slew {
    /// Largest rate (V/s) of a voltage that has to change by `away` (V).
    fn limit(&self, away: f64) -> f64 {
        self.rate * if away > 0.0 { self.rising } else { 1.0 }
    }

    /// S·T (V).
    fn scale(&self, away: f64) -> f64 {
        self.linear * self.limit(away)
    }
}

impl Law for Slew {
    /// A jump begins a ramp at its moment, not at the step's.
    const PARTS: usize = 16;

    /// More than one where a ramp begins or ends within the step, or T rounds its end.
    fn parts_between(&self, dt: f64, state: &[f64], from: &[f64], to: &[f64]) -> usize {
        let is_bent = |((state, from), to): ((&f64, &f64), &f64)| {
            let (change, away) = (to - from, to - state);
            let begins = change.abs() > self.limit(change) * dt;
            let is_behind = (from - state).abs() > change.abs() + ARRIVED;
            // The state is that in the middle of the last step.
            let ends = is_behind && away.abs() < 1.5 * self.limit(away) * dt;
            let is_round =
                self.linear > 0.0 && away.abs() > ARRIVED && away.abs() - self.limit(away) * dt < FAR * self.scale(away);
            begins || ends || is_round
        };
        if state.iter().zip(from).zip(to).any(is_bent) { Self::PARTS } else { 1 }
    }

    fn follow(&self, _dt: f64, since: f64, state: &mut [f64], volts: &mut [f64]) {
        let most = self.rate * since;
        for (state, volts) in state.iter_mut().zip(volts) {
            // From the middle of the last step to the middle of this one: the mean of a straight line is its value there.
            let away = *volts - *state;
            if self.linear > 0.0 {
                let scale = self.scale(away);
                *state = *volts - away.signum() * scale * approached(away.abs() / scale, since / self.linear);
            } else {
                *state += away.clamp(-most, self.rising * most);
            }
            *volts = *state;
        }
    }
}

/// x(s) for dx/ds = −tanh(x) from x ≥ 0, but for rounding near 1: sinh x falls by e^−s.
fn approached(x: f64, s: f64) -> f64 {
    if x - s > FAR {
        return x - s;
    }
    let sinh = 0.5 * ((x - s).exp() - (-x - s).exp());
    (sinh + (sinh * sinh + 1.0).sqrt()).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{Applied, SignalChain, SignalStage};

    #[test]
    fn a_soft_limit_is_a_ramp_far_away_and_a_lag_close_by() {
        // The middle of the last step is at `time`.
        let follow = |from: f64, time: f64| {
            let mut slew = Follower::new(Slew { rate: 1e4, rising: 2.0, linear: 0.01 }, 1);
            slew.settle(&mut [from]);
            (0..1000).for_each(|_| slew.pass(time / 999.5, &mut [0.0]));
            slew.state()[0]
        };
        // 100 V is the scale of falling voltages, 200 V that of rising ones.
        assert!((follow(2000.0, 0.1) - 1000.0).abs() < 1e-3, "{}", follow(2000.0, 0.1));
        assert!((follow(-4000.0, 0.1) + 2000.0).abs() < 1e-3, "{}", follow(-4000.0, 0.1));
        assert!((follow(1e-3, 0.01) - 1e-3 * (-1.0_f64).exp()).abs() < 1e-9, "{}", follow(1e-3, 0.01));
    }

    #[test]
    fn rising_voltages_may_have_another_limit() {
        let mut slew = Follower::new(Slew { rate: 1e4, rising: 2.0, linear: 0.0 }, 1);
        (0..10).for_each(|_| slew.pass(1e-3, &mut [1000.0]));
        assert!((slew.state()[0] - 190.0).abs() < 1e-9);
        (0..10).for_each(|_| slew.pass(1e-3, &mut [-1000.0]));
        assert!((slew.state()[0] - 90.0).abs() < 1e-9);
    }

    #[test]
    fn a_jump_becomes_a_ramp_of_the_limiting_rate() {
        let mut slew = Follower::new(Slew { rate: 1e4, rising: 1.0, linear: 0.0 }, 1);
        let mut sum = 0.0;
        for _ in 0..200 {
            let mut volts = [-1000.0];
            slew.pass(1e-3, &mut volts);
            sum += 1e-3 * volts[0];
        }
        // 0.1 s of ramp is behind by 0.05 s in the mean.
        assert!((sum + 1000.0 * (0.2 - 0.05)).abs() < 1e-9, "{sum}");
    }

    #[test]
    fn steps_are_divided_where_the_voltage_bends_within_them_and_nowhere_else() {
        // Up and down by 300 V at 7.26 ms, in the first part of a step of 0.25 ms, and at 43.9 ms.
        let (dt, steps) = (2.5e-4, 400);
        let command = |t: f64| if (0.00726..0.0439).contains(&t) { 300.0 } else { 0.0 };
        let mean = |from: f64, to: f64| {
            let jump = [0.00726, 0.0439].into_iter().find(|jump| (from..to).contains(jump));
            jump.map_or(command(from), |jump| (command(from) * (jump - from) + command(to) * (to - jump)) / (to - from))
        };
        // Mean voltages of all steps, and how many steps were divided.
        let run = |linear: f64, parts: &dyn Fn(&SignalChain, f64) -> usize| {
            let mut slew = SignalChain::new(&[Applied { effect: &SLEW_LIMIT, values: vec![4e4, 0.5, linear] }], 1, 0.1);
            let step = |k: u16| {
                let from = dt * f64::from(k);
                let n = parts(&slew, from);
                let part = |j: usize| {
                    let [a, b] = [j, j + 1].map(|j| from + dt * j as f64 / n as f64);
                    let mut volts = [mean(a, b)];
                    slew.pass(dt / n as f64, &mut volts);
                    volts[0] / n as f64
                };
                ((0..n).map(part).sum::<f64>(), n > 1)
            };
            let (volts, divided): (Vec<f64>, Vec<bool>) = (0..steps).map(step).unzip();
            (volts, divided.into_iter().filter(|divided| *divided).count())
        };
        // A ramp begins in the middle of the part before that of its jump, and in the part in which it ends the mean is off by an eighth of what the limit lets through.
        let (early, largest_error) = (300.0 * 1.5 * dt / 16.0, 4e4 * dt / 16.0 * (1.5 + 1.0 / 8.0));
        for (linear, most) in [(0.0, 6), (3e-4, 80)] {
            let (exact, _) = run(linear, &|_, _| 1024);
            let (volts, divided) =
                run(linear, &|slew, t| slew.parts_of_step(dt, &[0.0, 1.0, 2.0].map(|k| vec![command(t + k * dt)])));
            let apart: Vec<f64> = volts.iter().zip(&exact).map(|(a, b)| a - b).collect();
            let largest = apart.iter().fold(0.0_f64, |most, apart| most.max(apart.abs()));
            let sum = dt * apart.iter().sum::<f64>();
            assert!((1..=most).contains(&divided), "{divided} steps of {steps}");
            assert!(largest < largest_error && sum.abs() < early, "{linear}: {largest} V, {sum} V s");
        }
    }
}
