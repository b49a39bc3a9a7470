//! The charge constant grows with the field strength.
//!
//! ```text
//! θ_V = −γ·ℓ·V·(1 + b₁·|V| + b₂·V²)·(|V|/V₀)^p
//! ```
//!
//! # Parameters
//! * `slope_per_kv` (1/kV): b₁
//! * `curvature_per_kv2` (1/kV²): b₂
//! * `exponent` (–): p
//! * `reference_v` (V): V₀, at which the power is 1
//!
//! # Source
//! Data sheet of the MFC actuator: 400 pm/V below, 460 pm/V above 1 kV/mm; polynomial from general knowledge; powers: Hall, J. Mater. Sci. 36 (2001) 4575.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, SignalStage, fits};

/// See the file's head.
pub const FIELD_DEPENDENT_GAIN: Effect = Effect {
    id: "field-dependent-gain",
    kind: Kind::Actuation,
    cause: "The charge constant grows with the field strength.",
    equation: "θ_V = −γ·ℓ·V·(1 + b₁·|V| + b₂·V²)·(|V|/V₀)^p",
    source: "Data sheet of the MFC actuator: 400 pm/V below, 460 pm/V above 1 kV/mm; polynomial from general knowledge; powers: Hall, J. Mater. Sci. 36 (2001) 4575.",
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
        Parameter { name: "exponent", unit: "", bounds: [-0.9, 3.0], off: Some(0.0), default: Some(0.0), about: "p" },
        Parameter {
            name: "reference_v",
            unit: "V",
            bounds: [1.0, 10000.0],
            off: None,
            default: Some(1000.0),
            about: "V₀, at which the power is 1",
        },
    ],
    places: &[Place::VoltageCurve],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[Form {
            fitted: &[("exponent", 0.05), ("reference_v", 200.0)],
            starts: &[&[0.1, 300.0], &[0.1, 1000.0]],
            given: &[],
        }],
        forms: &[Form { fitted: &[("slope_per_kv", 0.05), ("curvature_per_kv2", 0.03)], starts: &[&[0.05, 0.0]], given: &[] }],
    },
    shape: None,
    action: Action::Voltages(|p, _, _| {
        Box::new(Gain { slope: 1e-3 * p[0], curvature: 1e-6 * p[1], exponent: p[2], reference: p[3] })
    }),
};

struct Gain {
    slope: f64,
    curvature: f64,
    exponent: f64,
    reference: f64,
}

impl SignalStage for Gain {
    fn settle(&mut self, volts: &mut [f64]) {
        for v in volts.iter_mut().filter(|v| **v != 0.0) {
            let polynomial = 1.0 + self.slope * v.abs() + self.curvature * *v * *v;
            let power = if self.exponent == 0.0 { 1.0 } else { (v.abs() / self.reference).powf(self.exponent) };
            *v *= polynomial * power;
        }
    }

    fn pass(&mut self, _dt: f64, volts: &mut [f64]) {
        self.settle(volts);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_is_one_at_its_reference_and_odd() {
        let mut volts = [500.0, -2000.0, 0.0];
        Gain { slope: 0.0, curvature: 0.0, exponent: 0.5, reference: 500.0 }.settle(&mut volts);
        assert_eq!(volts, [500.0, -4000.0, 0.0]);
    }
}
