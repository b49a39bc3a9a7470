//! The coefficient of friction differs from nominal.
//!
//! ```text
//! |F_t| ≤ s·μ_link·μ_ground·N
//! ```
//!
//! # Parameters
//! * `scale` (–): factor s on the coefficients
//!
//! # Source
//! The reference and Bullet: the product of two coefficients, at most 10.

use crate::effects::{Action, Effect, Kind, Parameter};

/// See the file's head.
pub const GROUND_FRICTION: Effect = Effect {
    id: "ground-friction",
    kind: Kind::Ground,
    cause: "The coefficient of friction differs from nominal.",
    equation: "|F_t| ≤ s·μ_link·μ_ground·N",
    source: "The reference and Bullet: the product of two coefficients, at most 10.",
    parameters: &[Parameter::scale([0.1, 5.0], "factor s on the coefficients")],
    action: Action::Robot(|p, robot| robot.extensions.friction_scale *= p[0]),
};
