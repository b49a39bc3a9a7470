//! The viscous coefficient differs from nominal.
//!
//! ```text
//! τ = −k·(θ − θ_V + s·η·θ̇)
//! ```
//!
//! # Parameters
//! * `scale` (–): factor s on the damping time η
//!
//! # Source
//! Derived from eq. 1; damping from a step response: Zheng et al., ICRA 2022.

use crate::effects::{Action, Effect, Kind, Parameter};

/// See the file's head.
pub const DAMPING: Effect = Effect {
    id: "damping",
    kind: Kind::Calibration,
    cause: "The viscous coefficient differs from nominal.",
    equation: "τ = −k·(θ − θ_V + s·η·θ̇)",
    source: "Derived from eq. 1; damping from a step response: Zheng et al., ICRA 2022.",
    parameters: &[Parameter::scale([0.02, 20.0], "factor s on the damping time η")],
    action: Action::Robot(|p, robot| robot.extensions.damping_scale *= p[0]),
};
