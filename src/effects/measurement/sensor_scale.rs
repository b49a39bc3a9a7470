//! Wrong pixels per millimetre, perspective, or gain.
//!
//! ```text
//! y_m = s·y
//! ```
//!
//! # Parameters
//! * `scale` (–): factor s on positions
//!
//! # Source
//! From general knowledge.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const SENSOR_SCALE: Effect = Effect {
    id: "sensor-scale",
    kind: Kind::Measurement,
    cause: "Wrong pixels per millimetre, perspective, or gain.",
    equation: "y_m = s·y",
    source: "From general knowledge.",
    parameters: &[Parameter::scale([0.5, 2.0], "factor s on positions")],
    places: &[Place::Picture],
    fitting: Fitting::Candidate { on: fits::any, forms: &[Form { fitted: &[("scale", 0.02)], starts: &[&[1.02]], given: &[] }] },
    shape: None,
    action: Action::View(|p, view| view.scale *= p[0]),
};
