//! The amplifier's current limit bounds the rate of voltage.
//!
//! ```text
//! |dV_a/dt| ≤ S, otherwise V_a = V_c
//! ```
//!
//! # Parameters
//! * `rate_v_per_s` (V/s): largest rate S
//!
//! # Source
//! Derived: S = I_max/C.

use super::follower::{Follower, Law};
use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const SLEW_LIMIT: Effect = Effect {
    id: "slew-limit",
    kind: Kind::Driver,
    cause: "The amplifier's current limit bounds the rate of voltage.",
    equation: "|dV_a/dt| ≤ S, otherwise V_a = V_c",
    source: "Derived: S = I_max/C.",
    parameters: &[Parameter {
        name: "rate_v_per_s",
        unit: "V/s",
        bounds: [100.0, 1e9],
        off: Some(f64::INFINITY),
        default: None,
        about: "largest rate S",
    }],
    places: &[Place::Drive],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form {
            fitted: &[("rate_v_per_s", 2e-06)],
            starts: &[&[1.5e-06], &[3e-06], &[6e-06], &[1.2e-05], &[2.5e-05]],
            given: &[],
        }],
    },
    shape: None,
    action: Action::Voltages(|p, n, _| Box::new(Follower::new(Slew { rate: p[0] }, n))),
};

/// The state is the voltage in the middle of the last step.
struct Slew {
    /// S (V/s).
    rate: f64,
}

impl Law for Slew {
    /// A jump begins a ramp at its moment, not at the step's.
    const PARTS: usize = 16;

    fn follow(&self, dt: f64, state: &mut [f64], volts: &mut [f64]) {
        let most = self.rate * dt;
        for (state, volts) in state.iter_mut().zip(volts) {
            // From the middle of the last step to the middle of this one: the mean of a straight line is its value there.
            *state += (*volts - *state).clamp(-most, most);
            *volts = *state;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::SignalStage;

    #[test]
    fn a_jump_becomes_a_ramp_of_the_limiting_rate() {
        let mut slew = Follower::new(Slew { rate: 1e4 }, 1);
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
