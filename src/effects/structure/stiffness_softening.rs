//! The piezo layer softens with strain; large bending may harden it instead.
//!
//! ```text
//! τ = −k·(δ·(1 − a·κ₀²·(|δ|/(ℓ·κ₀))^p) + η·θ̇),  δ = θ − θ_V,  κ₀ = 2/m,  bracket at least 0.5
//! ```
//!
//! # Parameters
//! * `softening_mm2` (mm²): the factor a
//! * `exponent` (–): power p of the deviation; 2 is the cubic law
//!
//! # Source
//! Tan and Erturk, doi:10.1117/12.2301000; cubic form from general knowledge; p = 1: Leadenham and Erturk, Nonlinear Dyn. 79 (2015) 1727.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const STIFFNESS_SOFTENING: Effect = Effect {
    id: "stiffness-softening",
    kind: Kind::Structure,
    cause: "The piezo layer softens with strain; large bending may harden it instead.",
    equation: "τ = −k·(δ·(1 − a·κ₀²·(|δ|/(ℓ·κ₀))^p) + η·θ̇),  δ = θ − θ_V,  κ₀ = 2/m,  bracket at least 0.5",
    source: "Tan and Erturk, doi:10.1117/12.2301000; cubic form from general knowledge; p = 1: Leadenham and Erturk, Nonlinear Dyn. 79 (2015) 1727.",
    parameters: &[
        Parameter {
            name: "softening_mm2",
            unit: "mm²",
            bounds: [-20000.0, 20000.0],
            off: Some(0.0),
            default: None,
            about: "the factor a",
        },
        Parameter {
            name: "exponent",
            unit: "",
            bounds: [0.1, 4.0],
            off: None,
            default: Some(2.0),
            about: "power p of the deviation; 2 is the cubic law",
        },
    ],
    places: &[Place::JointMomentOfDeviation],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[Form {
            fitted: &[("softening_mm2", 500.0), ("exponent", 0.4)],
            starts: &[&[500.0, 1.0], &[-300.0, 1.0]],
            given: &[],
        }],
        forms: &[Form { fitted: &[("softening_mm2", 500.0)], starts: &[&[500.0], &[-300.0]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| {
        robot.extensions.softening += 0.01 * p[0];
        robot.extensions.softening_exponent = p[1];
    }),
};
