//! The loss per cycle in the material is nearly independent of frequency, unlike viscous loss.
//!
//! ```text
//! τ = −k·(θ − θ_V + η·θ̇ + ξ·Σ q_j),  q̇_j = θ̇ − q_j/T_j,  T_j = 10^j s,  loss factor 0.68·ξ
//! ```
//!
//! # Parameters
//! * `loss_factor` (–): loss factor η_h; the damping ratio is half of it
//!
//! # Source
//! Derived: a ladder of relaxations with log-uniform times.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const STRUCTURAL_DAMPING: Effect = Effect {
    id: "structural-damping",
    kind: Kind::Structure,
    cause: "The loss per cycle in the material is nearly independent of frequency, unlike viscous loss.",
    equation: "τ = −k·(θ − θ_V + η·θ̇ + ξ·Σ q_j),  q̇_j = θ̇ − q_j/T_j,  T_j = 10^j s,  loss factor 0.68·ξ",
    source: "Derived: a ladder of relaxations with log-uniform times.",
    parameters: &[Parameter {
        name: "loss_factor",
        unit: "",
        bounds: [0.0, 0.2],
        off: Some(0.0),
        default: None,
        about: "loss factor η_h; the damping ratio is half of it",
    }],
    places: &[Place::JointMemory, Place::JointMomentOfRate],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form { fitted: &[("loss_factor", 0.02)], starts: &[&[0.02]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| robot.extensions.loss.iter_mut().for_each(|share| *share += p[0] / 0.68)),
};
