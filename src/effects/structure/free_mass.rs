//! Mass is added along the sheet.
//!
//! ```text
//! m(s) = μ_A·w + Σ m_j δ(s − s_j)
//! ```
//!
//! # Parameters
//! * `mass_1_g` (g): mass at 1/4 of the length
//! * `mass_2_g` (g): mass at 2/4 of the length
//! * `mass_3_g` (g): mass at 3/4 of the length
//! * `mass_4_g` (g): mass at 4/4 of the length
//!
//! # Source
//! Derived.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape, fits};
use crate::model::PointMass;

/// See the file's head.
pub const FREE_MASS: Effect = Effect {
    id: "free-mass",
    kind: Kind::Structure,
    cause: "Mass is added along the sheet.",
    equation: "m(s) = μ_A·w + Σ m_j δ(s − s_j)",
    source: "Derived.",
    parameters: &[
        Parameter {
            name: "mass_1_g",
            unit: "g",
            bounds: [0.0, 5.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "mass at 1/4 of the length",
        },
        Parameter {
            name: "mass_2_g",
            unit: "g",
            bounds: [0.0, 5.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "mass at 2/4 of the length",
        },
        Parameter {
            name: "mass_3_g",
            unit: "g",
            bounds: [0.0, 5.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "mass at 3/4 of the length",
        },
        Parameter {
            name: "mass_4_g",
            unit: "g",
            bounds: [0.0, 5.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "mass at 4/4 of the length",
        },
    ],
    places: &[Place::Mass],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form {
            fitted: &[("mass_1_g", 0.1), ("mass_2_g", 0.1), ("mass_3_g", 0.1), ("mass_4_g", 0.1)],
            starts: &[&[0.1, 0.0, 0.0, 0.0], &[0.0, 0.1, 0.0, 0.0], &[0.0, 0.0, 0.1, 0.0], &[0.0, 0.0, 0.0, 0.1]],
            given: &[],
        }],
    },
    shape: Some(Shape {
        x: "share of the length",
        x_unit: "",
        y: "mass",
        y_unit: "g",
        points: |p| p.iter().enumerate().map(|(k, mass)| [0.25 * (k + 1) as f64, *mass]).collect(),
    }),
    action: Action::Robot(|p, robot| {
        let end = robot.material.actuator_length * robot.actuators as f64;
        let of = |(k, mass): (usize, &f64)| PointMass { mass: *mass, position: 0.25 * (k + 1) as f64 * end };
        robot.extensions.point_masses.extend(p.iter().enumerate().map(of).filter(|point| point.mass > 0.0));
    }),
};
