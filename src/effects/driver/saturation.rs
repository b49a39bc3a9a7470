//! The amplifier or a protection limits the level of the voltage.
//!
//! ```text
//! V_a = min(V_hi, max(V_lo, V_c));  with softness s: V_a = V_c/(1 + (V_c/V_lim)^(1/s))^s
//! ```
//!
//! # Parameters
//! * `max_v` (V): largest voltage V_hi
//! * `min_v` (V): least voltage V_lo
//! * `softness` (–): s: 0 is a corner at the limit, ½ a smooth approach
//!
//! # Source
//! Limits of the MFC actuator: data sheet, Smart Material Corp.; soft limits: Rapp, Proc. 2nd Eur. Conf. Satellite Commun., 1991.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, SignalStage, fits};

/// See the file's head.
pub const SATURATION: Effect = Effect {
    id: "saturation",
    kind: Kind::Driver,
    cause: "The amplifier or a protection limits the level of the voltage.",
    equation: "V_a = min(V_hi, max(V_lo, V_c));  with softness s: V_a = V_c/(1 + (V_c/V_lim)^(1/s))^s",
    source: "Limits of the MFC actuator: data sheet, Smart Material Corp.; soft limits: Rapp, Proc. 2nd Eur. Conf. Satellite Commun., 1991.",
    parameters: &[
        Parameter {
            name: "max_v",
            unit: "V",
            bounds: [0.0, 5000.0],
            off: Some(f64::INFINITY),
            default: Some(f64::INFINITY),
            about: "largest voltage V_hi",
        },
        Parameter {
            name: "min_v",
            unit: "V",
            bounds: [-5000.0, 0.0],
            off: Some(f64::NEG_INFINITY),
            default: Some(f64::NEG_INFINITY),
            about: "least voltage V_lo",
        },
        Parameter {
            name: "softness",
            unit: "",
            bounds: [0.0, 1.0],
            off: None,
            default: Some(0.0),
            about: "s: 0 is a corner at the limit, ½ a smooth approach",
        },
    ],
    places: &[Place::VoltageCurve, Place::Drive],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[
            Form {
                fitted: &[("min_v", 0.0002), ("softness", 0.1)],
                starts: &[&[-1.0 / 1300.0, 0.2], &[-1.0 / 1000.0, 0.2]],
                given: &[],
            },
            Form {
                fitted: &[("max_v", 0.0002), ("softness", 0.1)],
                starts: &[&[1.0 / 800.0, 0.2], &[1.0 / 400.0, 0.2]],
                given: &[],
            },
        ],
        forms: &[
            Form { fitted: &[("min_v", 0.0002)], starts: &[&[-1.0 / 1300.0], &[-1.0 / 1000.0], &[-1.0 / 700.0]], given: &[] },
            Form {
                fitted: &[("max_v", 0.0002)],
                starts: &[&[1.0 / 1300.0], &[1.0 / 800.0], &[1.0 / 400.0], &[1.0 / 200.0]],
                given: &[],
            },
        ],
    },
    shape: None,
    action: Action::Voltages(|p, _, _| Box::new(Limits { max: p[0], min: p[1], softness: p[2] })),
};

struct Limits {
    max: f64,
    min: f64,
    softness: f64,
}

impl SignalStage for Limits {
    fn settle(&mut self, volts: &mut [f64]) {
        let soft = |v: f64| {
            let share = v / if v > 0.0 { self.max } else { self.min };
            // share·(1 + share^(−1/s))^s beyond the limit: the other power would be huge.
            let less = share.min(1.0 / share);
            v / (share.max(1.0) * (1.0 + less.powf(1.0 / self.softness)).powf(self.softness))
        };
        volts.iter_mut().for_each(|v| {
            let is_soft = self.softness > 0.0 && *v != 0.0;
            *v = if is_soft { soft(*v) } else { *v }.max(self.min).min(self.max);
        });
    }

    fn pass(&mut self, _dt: f64, volts: &mut [f64]) {
        self.settle(volts);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_soft_limit_is_straight_at_first_and_the_limit_at_last() {
        let limited = |volts: f64, softness: f64| {
            let mut volts = [volts];
            Limits { max: 500.0, min: f64::NEG_INFINITY, softness }.settle(&mut volts);
            volts[0]
        };
        assert_eq!((limited(400.0, 0.0), limited(600.0, 0.0), limited(-900.0, 0.5)), (400.0, 500.0, -900.0));
        // s = ½: V/√(1 + (V/V_hi)²).
        assert!((limited(500.0, 0.5) - 500.0 / 2.0_f64.sqrt()).abs() < 1e-9);
        assert!((limited(1.0, 0.5) - 1.0).abs() < 1e-5 && (limited(1e9, 0.5) - 500.0).abs() < 1e-6);
        // Hardly soft is hard.
        assert!((limited(900.0, 1e-3) - 500.0).abs() < 1.0 && (limited(400.0, 1e-3) - 400.0).abs() < 1.0);
        assert!(limited(1e5, 1e-6).is_finite());
    }
}
