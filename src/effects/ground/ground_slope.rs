//! The ground is not level.
//!
//! ```text
//! gravity (−g·sin α, −g·cos α) in the ground's axes
//! ```
//!
//! # Parameters
//! * `angle_deg` (°): slope α, positive uphill along +x
//!
//! # Source
//! Derived.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const GROUND_SLOPE: Effect = Effect {
    id: "ground-slope",
    kind: Kind::Ground,
    cause: "The ground is not level.",
    equation: "gravity (−g·sin α, −g·cos α) in the ground's axes",
    source: "Derived.",
    parameters: &[Parameter {
        name: "angle_deg",
        unit: "°",
        bounds: [-45.0, 45.0],
        off: Some(0.0),
        default: None,
        about: "slope α, positive uphill along +x",
    }],
    places: &[Place::Floor],
    fitting: Fitting::Candidate {
        on: fits::on_the_floor,
        forms: &[Form { fitted: &[("angle_deg", 0.5)], starts: &[&[0.5]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| robot.extensions.slope += p[0].to_radians()),
};
