//! The sheet pushes air; the force grows with the square of the speed.
//!
//! ```text
//! f = −½·ρ·C_d·w·v·|v|,  v normal to the sheet
//! ```
//!
//! # Parameters
//! * `drag_coefficient` (–): drag coefficient C_d
//!
//! # Source
//! Textbook drag of a plate; sizes derived.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const AIR_DRAG: Effect = Effect {
    id: "air-drag",
    kind: Kind::Structure,
    cause: "The sheet pushes air; the force grows with the square of the speed.",
    equation: "f = −½·ρ·C_d·w·v·|v|,  v normal to the sheet",
    source: "Textbook drag of a plate; sizes derived.",
    parameters: &[Parameter {
        name: "drag_coefficient",
        unit: "",
        bounds: [0.0, 40.0],
        off: Some(0.0),
        default: None,
        about: "drag coefficient C_d",
    }],
    places: &[Place::Air],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form { fitted: &[("drag_coefficient", 1.0)], starts: &[&[1.0], &[4.0]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| robot.extensions.drag[1] += p[0]),
};
