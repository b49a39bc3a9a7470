//! Rubbing in the laminate, wires or clamp opposes motion with a constant moment.
//!
//! ```text
//! τ = −k·(θ − θ_V + η·θ̇) − τ_c·tanh(θ̇/ω_ε);  with presliding κ: four equal springs that slip at κ/4, 3κ/4, 5κ/4, 7κ/4 instead of tanh
//! ```
//!
//! # Parameters
//! * `moment_mn_m` (mN·m): the moment τ_c in every joint
//! * `presliding_per_m` (1/m): mean curvature κ from which it slides; 0 is none
//!
//! # Source
//! Symptoms: Worden and Tomlinson, Nonlinearity in Structural Dynamics, 2001; Kerschen et al. 2006. Presliding: Iwan, J. Appl. Mech. 33 (1966) 893.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};
use crate::model::Slip;

/// See the file's head.
pub const DRY_FRICTION: Effect = Effect {
    id: "dry-friction",
    kind: Kind::Structure,
    cause: "Rubbing in the laminate, wires or clamp opposes motion with a constant moment.",
    equation: "τ = −k·(θ − θ_V + η·θ̇) − τ_c·tanh(θ̇/ω_ε);  with presliding κ: four equal springs that slip at κ/4, 3κ/4, 5κ/4, 7κ/4 instead of tanh",
    source: "Symptoms: Worden and Tomlinson, Nonlinearity in Structural Dynamics, 2001; Kerschen et al. 2006. Presliding: Iwan, J. Appl. Mech. 33 (1966) 893.",
    parameters: &[
        Parameter {
            name: "moment_mn_m",
            unit: "mN·m",
            bounds: [0.0, 3.0],
            off: Some(0.0),
            default: None,
            about: "the moment τ_c in every joint",
        },
        Parameter {
            name: "presliding_per_m",
            unit: "1/m",
            bounds: [0.0, 100.0],
            off: None,
            default: Some(0.0),
            about: "mean curvature κ from which it slides; 0 is none",
        },
    ],
    places: &[Place::JointMomentOfRate, Place::JointMemory],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[Form {
            fitted: &[("moment_mn_m", 0.1), ("presliding_per_m", 0.1)],
            starts: &[&[0.05, 0.3], &[0.3, 0.3], &[0.05, 1.0], &[0.3, 1.0]],
            given: &[],
        }],
        forms: &[Form { fitted: &[("moment_mn_m", 0.1)], starts: &[&[0.05], &[0.3]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| match *p {
        [moment, presliding] if presliding > 0.0 => {
            let slip = |share: f64| Slip { moment: 0.25e4 * moment, curvature: 0.01 * share * presliding };
            robot.extensions.slips.extend([0.25, 0.75, 1.25, 1.75].map(slip));
        }
        _ => robot.extensions.dry_friction += 1e4 * p[0],
    }),
};
