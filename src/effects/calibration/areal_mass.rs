//! The mass per area differs from nominal: density, glue or coating.
//!
//! ```text
//! M = s·μ_A·w·L
//! ```
//!
//! # Parameters
//! * `scale` (–): factor s on the mass of every link
//!
//! # Source
//! Derived; data sheet of the MFC actuator, Smart Material Corp.

use crate::effects::{Action, Effect, Kind, Parameter};

/// See the file's head.
pub const AREAL_MASS: Effect = Effect {
    id: "areal-mass",
    kind: Kind::Calibration,
    cause: "The mass per area differs from nominal: density, glue or coating.",
    equation: "M = s·μ_A·w·L",
    source: "Derived; data sheet of the MFC actuator, Smart Material Corp.",
    parameters: &[Parameter::scale([0.5, 2.0], "factor s on the mass of every link")],
    action: Action::Robot(|p, robot| robot.extensions.mass_scale *= p[0]),
};
