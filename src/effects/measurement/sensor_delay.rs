//! Exposure, transfer or a filter delays the record.
//!
//! ```text
//! y_m(t) = y(t − T)
//! ```
//!
//! # Parameters
//! * `delay_s` (s): delay T
//!
//! # Source
//! Derived.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const SENSOR_DELAY: Effect = Effect {
    id: "sensor-delay",
    kind: Kind::Measurement,
    cause: "Exposure, transfer or a filter delays the record.",
    equation: "y_m(t) = y(t − T)",
    source: "Derived.",
    parameters: &[Parameter { name: "delay_s", unit: "s", bounds: [0.0, 0.1], off: Some(0.0), default: None, about: "delay T" }],
    places: &[Place::Picture],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form { fitted: &[("delay_s", 0.002)], starts: &[&[0.001], &[0.005]], given: &[] }],
    },
    shape: None,
    action: Action::View(|p, view| view.delay += p[0]),
};
