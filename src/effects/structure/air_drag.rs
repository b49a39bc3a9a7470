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

use crate::effects::{Action, Effect, Kind, Parameter};

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
    action: Action::Robot(|p, robot| robot.extensions.drag += p[0]),
};
