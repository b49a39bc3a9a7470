//! The strain per volt differs along and against the direction of poling.
//!
//! ```text
//! θ_V = −γ·ℓ·r·V for V > 0, −γ·ℓ·V otherwise
//! ```
//!
//! # Parameters
//! * `ratio` (–): gain r of positive voltages, on top of positive_gain
//!
//! # Source
//! The reference's constant 1.733; asymmetry: nonlinear equivalent piezoelectric coefficient of MFCs, 2016.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, SignalStage, fits};

/// See the file's head.
pub const POLARITY_ASYMMETRY: Effect = Effect {
    id: "polarity-asymmetry",
    kind: Kind::Actuation,
    cause: "The strain per volt differs along and against the direction of poling.",
    equation: "θ_V = −γ·ℓ·r·V for V > 0, −γ·ℓ·V otherwise",
    source: "The reference's constant 1.733; asymmetry: nonlinear equivalent piezoelectric coefficient of MFCs, 2016.",
    parameters: &[Parameter {
        name: "ratio",
        unit: "",
        bounds: [0.2, 4.0],
        off: Some(1.0),
        default: None,
        about: "gain r of positive voltages, on top of positive_gain",
    }],
    places: &[Place::VoltageCurve],
    fitting: Fitting::Candidate { on: fits::any, forms: &[Form { fitted: &[("ratio", 0.2)], starts: &[&[1.2]], given: &[] }] },
    shape: None,
    action: Action::Voltages(|p, _, _| Box::new(Ratio(p[0]))),
};

struct Ratio(f64);

impl SignalStage for Ratio {
    fn settle(&mut self, volts: &mut [f64]) {
        volts.iter_mut().filter(|v| **v > 0.0).for_each(|v| *v *= self.0);
    }

    fn pass(&mut self, _dt: f64, volts: &mut [f64]) {
        self.settle(volts);
    }
}
