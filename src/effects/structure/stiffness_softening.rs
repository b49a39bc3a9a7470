//! The piezo layer softens with strain; large bending may harden it instead.
//!
//! ```text
//! τ = −k·(δ·(1 − a·(δ/ℓ)²) + η·θ̇),  δ = θ − θ_V,  bracket at least 0.5
//! ```
//!
//! # Parameters
//! * `softening_mm2` (mm²): the factor a
//!
//! # Source
//! Tan and Erturk, doi:10.1117/12.2301000; cubic form from general knowledge.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const STIFFNESS_SOFTENING: Effect = Effect {
    id: "stiffness-softening",
    kind: Kind::Structure,
    cause: "The piezo layer softens with strain; large bending may harden it instead.",
    equation: "τ = −k·(δ·(1 − a·(δ/ℓ)²) + η·θ̇),  δ = θ − θ_V,  bracket at least 0.5",
    source: "Tan and Erturk, doi:10.1117/12.2301000; cubic form from general knowledge.",
    parameters: &[Parameter {
        name: "softening_mm2",
        unit: "mm²",
        bounds: [-20000.0, 20000.0],
        off: Some(0.0),
        default: None,
        about: "the factor a",
    }],
    places: &[Place::JointMomentOfDeviation],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form { fitted: &[("softening_mm2", 500.0)], starts: &[&[500.0], &[-300.0]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| robot.extensions.softening += 0.01 * p[0]),
};
