//! Processing or transport delays the voltage.
//!
//! ```text
//! V_a(t) = V_c(t − T)
//! ```
//!
//! # Parameters
//! * `delay_s` (s): delay T
//!
//! # Source
//! Derived.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const TIME_DELAY: Effect = Effect {
    id: "time-delay",
    kind: Kind::Driver,
    cause: "Processing or transport delays the voltage.",
    equation: "V_a(t) = V_c(t − T)",
    source: "Derived.",
    parameters: &[Parameter { name: "delay_s", unit: "s", bounds: [0.0, 0.1], off: Some(0.0), default: None, about: "delay T" }],
    places: &[Place::Drive],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form { fitted: &[("delay_s", 0.002)], starts: &[&[0.001], &[0.005]], given: &[] }],
    },
    shape: None,
    action: Action::Drive(|p, drive| drive.delay += p[0]),
};
