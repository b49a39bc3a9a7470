//! The zero of the coordinates is wrong.
//!
//! ```text
//! y_m = y + y₀
//! ```
//!
//! # Parameters
//! * `x_mm` (mm): added to x
//! * `z_mm` (mm): added to z
//!
//! # Source
//! From general knowledge.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const SENSOR_OFFSET: Effect = Effect {
    id: "sensor-offset",
    kind: Kind::Measurement,
    cause: "The zero of the coordinates is wrong.",
    equation: "y_m = y + y₀",
    source: "From general knowledge.",
    parameters: &[
        Parameter { name: "x_mm", unit: "mm", bounds: [-100.0, 100.0], off: Some(0.0), default: Some(0.0), about: "added to x" },
        Parameter { name: "z_mm", unit: "mm", bounds: [-100.0, 100.0], off: Some(0.0), default: Some(0.0), about: "added to z" },
    ],
    places: &[Place::Picture],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form { fitted: &[("x_mm", 0.2), ("z_mm", 0.2)], starts: &[&[0.1, 0.1]], given: &[] }],
    },
    shape: None,
    action: Action::View(|p, view| view.offset = [view.offset[0] + 0.1 * p[0], view.offset[1] + 0.1 * p[1]]),
};
