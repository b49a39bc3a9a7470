//! The source's resistance charges the actuator's capacitance.
//!
//! ```text
//! T·dV_a/dt + V_a = V_c,  T = R·C
//! ```
//!
//! # Parameters
//! * `time_constant_s` (s): time constant T
//!
//! # Source
//! Capacitance per area: data sheet of the MFC actuator; derived.

use super::follower::{Follower, Law};
use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const DRIVER_LAG: Effect = Effect {
    id: "driver-lag",
    kind: Kind::Driver,
    cause: "The source's resistance charges the actuator's capacitance.",
    equation: "T·dV_a/dt + V_a = V_c,  T = R·C",
    source: "Capacitance per area: data sheet of the MFC actuator; derived.",
    parameters: &[Parameter {
        name: "time_constant_s",
        unit: "s",
        bounds: [0.0, 0.2],
        off: Some(0.0),
        default: None,
        about: "time constant T",
    }],
    places: &[Place::Drive],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form { fitted: &[("time_constant_s", 0.002)], starts: &[&[0.001], &[0.005]], given: &[] }],
    },
    shape: None,
    action: Action::Voltages(|p, n, _| Box::new(Follower::new(Lag { time: p[0] }, n))),
};

/// The state is the voltage at the end of the last step; exact for voltages that are constant over a step.
struct Lag {
    /// T (s).
    time: f64,
}

impl Law for Lag {
    fn follow(&self, dt: f64, state: &mut [f64], volts: &mut [f64]) {
        let steps = dt / self.time;
        // 1 − exp(−dt/T), and its mean over the step.
        let gone = -(-steps).exp_m1();
        let mean = gone / steps;
        for (state, volts) in state.iter_mut().zip(volts) {
            let away = *state - *volts;
            *state = *volts + away * (1.0 - gone);
            *volts += away * mean;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::SignalStage;

    #[test]
    fn a_step_response_is_the_exponential() {
        let mut lag = Follower::new(Lag { time: 0.01 }, 1);
        for _ in 0..25 {
            lag.pass(1e-3, &mut [100.0]);
        }
        assert!((lag.state()[0] - 100.0 * (1.0 - (-2.5_f64).exp())).abs() < 1e-12);
    }
}
