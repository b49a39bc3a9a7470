//! The clamp gives, so the root turns in proportion to the moment on it.
//!
//! ```text
//! φ = c·M_root
//! ```
//!
//! # Parameters
//! * `compliance_rad_per_n_m` (rad/(N·m)): turn c of the root per moment
//!
//! # Source
//! J. Lee, J. Mech. Sci. Technol. 27 (2013) 297: lower frequencies with a clamp that gives; factors derived.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const CLAMP_COMPLIANCE: Effect = Effect {
    id: "clamp-compliance",
    kind: Kind::Structure,
    cause: "The clamp gives, so the root turns in proportion to the moment on it.",
    equation: "φ = c·M_root",
    source: "J. Lee, J. Mech. Sci. Technol. 27 (2013) 297: lower frequencies with a clamp that gives; factors derived.",
    parameters: &[Parameter {
        name: "compliance_rad_per_n_m",
        unit: "rad/(N·m)",
        bounds: [0.0, 10.0],
        off: Some(0.0),
        default: None,
        about: "turn c of the root per moment",
    }],
    places: &[Place::Clamp],
    fitting: Fitting::Candidate {
        on: fits::clamped,
        forms: &[Form { fitted: &[("compliance_rad_per_n_m", 0.5)], starts: &[&[0.2], &[1.0]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| robot.extensions.clamp_compliance += 1e-7 * p[0]),
};
