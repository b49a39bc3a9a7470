//! Finitely many joints and a finite time step stand for a continuum.
//!
//! ```text
//! y(m, h) = y_∞ + a/m² + b·h^p
//! ```
//!
//! # Parameters
//! * `motors_per_actuator` (–): joints per actuator in place of the file’s; 0: the file’s
//! * `time_step_scale` (–): factor on the time step
//!
//! # Source
//! Derived: the chain against the Euler-Bernoulli beam.

use crate::effects::{Action, Effect, Fitting, Kind, Parameter, Place};

/// See the file's head.
pub const DISCRETISATION: Effect = Effect {
    id: "discretisation",
    kind: Kind::Numerics,
    cause: "Finitely many joints and a finite time step stand for a continuum.",
    equation: "y(m, h) = y_∞ + a/m² + b·h^p",
    source: "Derived: the chain against the Euler-Bernoulli beam.",
    parameters: &[
        Parameter {
            name: "motors_per_actuator",
            unit: "",
            bounds: [1.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "joints per actuator in place of the file’s; 0: the file’s",
        },
        Parameter {
            name: "time_step_scale",
            unit: "",
            bounds: [0.001, 1000.0],
            off: Some(1.0),
            default: Some(1.0),
            about: "factor on the time step",
        },
    ],
    places: &[Place::Discretisation],
    fitting: Fitting::Excluded("the search refines the discretisation by itself"),
    shape: None,
    action: Action::Discretisation,
};
