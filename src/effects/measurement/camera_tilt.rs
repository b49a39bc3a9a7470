//! The camera is rolled about its axis.
//!
//! ```text
//! x_m = x·cos ψ − z·sin ψ,  z_m = x·sin ψ + z·cos ψ
//! ```
//!
//! # Parameters
//! * `angle_deg` (°): roll ψ
//!
//! # Source
//! Derived.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const CAMERA_TILT: Effect = Effect {
    id: "camera-tilt",
    kind: Kind::Measurement,
    cause: "The camera is rolled about its axis.",
    equation: "x_m = x·cos ψ − z·sin ψ,  z_m = x·sin ψ + z·cos ψ",
    source: "Derived.",
    parameters: &[Parameter {
        name: "angle_deg",
        unit: "°",
        bounds: [-30.0, 30.0],
        off: Some(0.0),
        default: None,
        about: "roll ψ",
    }],
    places: &[Place::Picture],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form { fitted: &[("angle_deg", 0.5)], starts: &[&[0.3]], given: &[] }],
    },
    shape: None,
    action: Action::View(|p, view| view.tilt += p[0].to_radians()),
};
