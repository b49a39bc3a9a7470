//! The charge constant grows with the field strength.
//!
//! ```text
//! θ_V = −γ·ℓ·V·(1 + b₁·|V| + b₂·V²)
//! ```
//!
//! # Parameters
//! * `slope_per_kv` (1/kV): b₁
//! * `curvature_per_kv2` (1/kV²): b₂
//!
//! # Source
//! Data sheet of the MFC actuator: 400 pm/V below, 460 pm/V above 1 kV/mm; polynomial from general knowledge.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, SignalStage, fits};

/// See the file's head.
pub const FIELD_DEPENDENT_GAIN: Effect = Effect {
    id: "field-dependent-gain",
    kind: Kind::Actuation,
    cause: "The charge constant grows with the field strength.",
    equation: "θ_V = −γ·ℓ·V·(1 + b₁·|V| + b₂·V²)",
    source: "Data sheet of the MFC actuator: 400 pm/V below, 460 pm/V above 1 kV/mm; polynomial from general knowledge.",
    parameters: &[
        Parameter { name: "slope_per_kv", unit: "1/kV", bounds: [-0.5, 1.0], off: Some(0.0), default: Some(0.0), about: "b₁" },
        Parameter {
            name: "curvature_per_kv2",
            unit: "1/kV²",
            bounds: [-0.5, 0.5],
            off: Some(0.0),
            default: Some(0.0),
            about: "b₂",
        },
    ],
    places: &[Place::VoltageCurve],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form { fitted: &[("slope_per_kv", 0.05), ("curvature_per_kv2", 0.03)], starts: &[&[0.05, 0.0]], given: &[] }],
    },
    shape: None,
    action: Action::Voltages(|p, _, _| Box::new(Gain { slope: 1e-3 * p[0], curvature: 1e-6 * p[1] })),
};

struct Gain {
    slope: f64,
    curvature: f64,
}

impl SignalStage for Gain {
    fn settle(&mut self, volts: &mut [f64]) {
        volts.iter_mut().for_each(|v| *v *= 1.0 + self.slope * v.abs() + self.curvature * *v * *v);
    }

    fn pass(&mut self, _dt: f64, volts: &mut [f64]) {
        self.settle(volts);
    }
}
