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

/// The state is the voltage in the middle of the last step.
struct Slew {
    /// S (V/s).
    rate: f64,
    /// r.
    rising: f64,
    /// T (s).
    linear: f64,
}

impl Law for Slew {
    /// A jump begins a ramp at its moment, not at the step's.
    const PARTS: usize = 16;

    fn follow(&self, dt: f64, state: &mut [f64], volts: &mut [f64]) {
        let most = self.rate * dt;
        for (state, volts) in state.iter_mut().zip(volts) {
            // From the middle of the last step to the middle of this one: the mean of a straight line is its value there.
            let away = *volts - *state;
            if self.linear > 0.0 {
                let scale = self.linear * if away > 0.0 { self.rising * self.rate } else { self.rate };
                *state = *volts - away.signum() * scale * approached(away.abs() / scale, dt / self.linear);
            } else {
                *state += away.clamp(-most, self.rising * most);
            }
            *volts = *state;
        }
    }
}

/// x(s) for dx/ds = −tanh(x) from x ≥ 0: sinh x falls by e^−s.
fn approached(x: f64, s: f64) -> f64 {
    // Logarithm of 2 sinh x.
    let logarithm = x - s + (-(-2.0 * x).exp()).ln_1p();
    if logarithm > 30.0 { logarithm } else { (0.5 * logarithm.exp()).asinh() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::SignalStage;

    #[test]
    fn a_soft_limit_is_a_ramp_far_away_and_a_lag_close_by() {
        let follow = |from: f64, time: f64| {
            let mut slew = Follower::new(Slew { rate: 1e4, rising: 2.0, linear: 0.01 }, 1);
            slew.settle(&mut [from]);
            (0..1000).for_each(|_| slew.pass(1e-3 * time, &mut [0.0]));
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
        assert!((slew.state()[0] - 200.0).abs() < 1e-9);
        (0..10).for_each(|_| slew.pass(1e-3, &mut [-1000.0]));
        assert!((slew.state()[0] - 100.0).abs() < 1e-9);
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
        // 0.1 s of ramp is behind by 0.05 s in the mean; the first step's mean is taken as reached in its middle, half a step early.
        assert!((sum + 1000.0 * (0.2 - 0.05 + 0.0005)).abs() < 1e-9, "{sum}");
    }
}
