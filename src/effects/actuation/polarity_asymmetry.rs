//! The strain per volt differs along and against the direction of poling.
//!
//! ```text
//! θ_V = −γ·ℓ·V·(1 + (r − 1)·(V/300 V)^p) for V > 0, −γ·ℓ·V otherwise
//! ```
//!
//! # Parameters
//! * `ratio` (–): gain r of positive voltages, on top of positive_gain; with an exponent that at 300 V
//! * `exponent` (–): power p with which it sets in
//!
//! # Source
//! The reference's constant 1.733; asymmetry: nonlinear equivalent piezoelectric coefficient of MFCs, 2016.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, SignalStage, fits};

/// See the file's head.
pub const POLARITY_ASYMMETRY: Effect = Effect {
    id: "polarity-asymmetry",
    kind: Kind::Actuation,
    cause: "The strain per volt differs along and against the direction of poling.",
    equation: "θ_V = −γ·ℓ·V·(1 + (r − 1)·(V/300 V)^p) for V > 0, −γ·ℓ·V otherwise",
    source: "The reference's constant 1.733; asymmetry: nonlinear equivalent piezoelectric coefficient of MFCs, 2016.",
    parameters: &[
        Parameter {
            name: "ratio",
            unit: "",
            bounds: [0.2, 4.0],
            off: Some(1.0),
            default: None,
            about: "gain r of positive voltages, on top of positive_gain; with an exponent that at 300 V",
        },
        Parameter {
            name: "exponent",
            unit: "",
            bounds: [-0.9, 4.0],
            off: None,
            default: Some(0.0),
            about: "power p with which it sets in",
        },
    ],
    places: &[Place::VoltageCurve],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[Form {
            fitted: &[("ratio", 0.2), ("exponent", 0.2)],
            starts: &[&[1.2, 0.5], &[1.2, -0.3], &[0.8, -0.3]],
            given: &[],
        }],
        forms: &[Form { fitted: &[("ratio", 0.2)], starts: &[&[1.2]], given: &[] }],
    },
    shape: None,
    action: Action::Voltages(|p, _, _| Box::new(Ratio { ratio: p[0], exponent: p[1] })),
};

struct Ratio {
    ratio: f64,
    exponent: f64,
}

impl SignalStage for Ratio {
    fn settle(&mut self, volts: &mut [f64]) {
        let factor = |v: f64| 1.0 + (self.ratio - 1.0) * (v / 300.0).powf(self.exponent);
        volts.iter_mut().filter(|v| **v > 0.0).for_each(|v| *v *= if self.exponent == 0.0 { self.ratio } else { factor(*v) });
    }

    fn pass(&mut self, _dt: f64, volts: &mut [f64]) {
        self.settle(volts);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exponent_lets_the_ratio_set_in_and_be_reached_at_300_v() {
        let mut volts = [300.0, 150.0, -150.0];
        Ratio { ratio: 1.4, exponent: 1.0 }.settle(&mut volts);
        let expected = [420.0, 180.0, -150.0];
        assert!(volts.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{volts:?}");
    }
}
