//! Moduli, thickness or bond differ from nominal, so every joint is stiffer or softer by one factor.
//!
//! ```text
//! τ = −s·k·(θ − θ_V + η·θ̇)
//! ```
//!
//! # Parameters
//! * `scale` (–): factor s on the stiffness k
//!
//! # Source
//! Derived from eq. 1; spread of MFC parameters: Hu, Smith, Hays, Oates, CDC-ECC 2011.

use crate::effects::{Action, Effect, Kind, Parameter};

/// See the file's head.
pub const STIFFNESS: Effect = Effect {
    id: "stiffness",
    kind: Kind::Calibration,
    cause: "Moduli, thickness or bond differ from nominal, so every joint is stiffer or softer by one factor.",
    equation: "τ = −s·k·(θ − θ_V + η·θ̇)",
    source: "Derived from eq. 1; spread of MFC parameters: Hu, Smith, Hays, Oates, CDC-ECC 2011.",
    parameters: &[Parameter::scale([0.5, 2.0], "factor s on the stiffness k")],
    action: Action::Robot(|p, robot| robot.extensions.stiffness_scale *= p[0]),
};
