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

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const AREAL_MASS: Effect = Effect {
    id: "areal-mass",
    kind: Kind::Calibration,
    cause: "The mass per area differs from nominal: density, glue or coating.",
    equation: "M = s·μ_A·w·L",
    source: "Derived; data sheet of the MFC actuator, Smart Material Corp.",
    parameters: &[Parameter::scale([0.5, 2.0], "factor s on the mass of every link")],
    places: &[Place::Mass],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[],
        forms: &[Form { fitted: &[("scale", 0.1)], starts: &[&[1.01], &[1.05]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| robot.extensions.mass_scale *= p[0]),
};
