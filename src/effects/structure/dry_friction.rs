//! Rubbing in the laminate, wires or clamp opposes motion with a constant moment.
//!
//! ```text
//! τ = −k·(θ − θ_V + η·θ̇) − τ_c·tanh(θ̇/ω_ε)
//! ```
//!
//! # Parameters
//! * `moment_mn_m` (mN·m): the moment τ_c in every joint
//!
//! # Source
//! Symptoms: Worden and Tomlinson, Nonlinearity in Structural Dynamics, 2001; Kerschen et al. 2006.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const DRY_FRICTION: Effect = Effect {
    id: "dry-friction",
    kind: Kind::Structure,
    cause: "Rubbing in the laminate, wires or clamp opposes motion with a constant moment.",
    equation: "τ = −k·(θ − θ_V + η·θ̇) − τ_c·tanh(θ̇/ω_ε)",
    source: "Symptoms: Worden and Tomlinson, Nonlinearity in Structural Dynamics, 2001; Kerschen et al. 2006.",
    parameters: &[Parameter {
        name: "moment_mn_m",
        unit: "mN·m",
        bounds: [0.0, 3.0],
        off: Some(0.0),
        default: None,
        about: "the moment τ_c in every joint",
    }],
    places: &[Place::JointMomentOfRate, Place::JointMemory],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form { fitted: &[("moment_mn_m", 0.1)], starts: &[&[0.05], &[0.3]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| robot.extensions.dry_friction += 1e4 * p[0]),
};
