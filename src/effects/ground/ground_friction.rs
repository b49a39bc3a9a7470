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

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const GROUND_FRICTION: Effect = Effect {
    id: "ground-friction",
    kind: Kind::Ground,
    cause: "The coefficient of friction differs from nominal.",
    equation: "|F_t| ≤ s·μ_link·μ_ground·N",
    source: "The reference and Bullet: the product of two coefficients, at most 10.",
    parameters: &[Parameter::scale([0.1, 5.0], "factor s on the coefficients")],
    places: &[Place::FloorFriction],
    fitting: Fitting::Candidate {
        on: fits::on_the_floor,
        forms: &[Form { fitted: &[("scale", 0.2)], starts: &[&[0.8], &[1.25]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| robot.extensions.friction_scale *= p[0]),
};
