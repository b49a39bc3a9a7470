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

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const STIFFNESS: Effect = Effect {
    id: "stiffness",
    kind: Kind::Calibration,
    cause: "Moduli, thickness or bond differ from nominal, so every joint is stiffer or softer by one factor.",
    equation: "τ = −s·k·(θ − θ_V + η·θ̇)",
    source: "Derived from eq. 1; spread of MFC parameters: Hu, Smith, Hays, Oates, CDC-ECC 2011.",
    parameters: &[Parameter::scale([0.5, 2.0], "factor s on the stiffness k")],
    places: &[Place::Stiffness],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[],
        forms: &[Form { fitted: &[("scale", 0.1)], starts: &[&[1.01], &[1.05]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| robot.extensions.stiffness_scale *= p[0]),
};
