//! The clamp gives, so the root turns with the moment on it.
//!
//! ```text
//! φ·(1 + (a·φ)²) + T·φ̇ = c·(1 + u·sign M_root)·M_root
//! ```
//!
//! # Parameters
//! * `compliance_rad_per_n_m` (rad/(N·m)): turn c of the root per moment
//! * `damping_s` (s): T: damping of the clamp over its stiffness
//! * `hardening_per_rad` (1/rad): a: a turn of 1/a takes twice the moment of a clamp that does not harden, as where play ends or faces come to bear
//! * `asymmetry` (–): u: the clamp gives by 1 + u times c to a moment that raises the free end, by 1 − u times c to one that lowers it, as where faces open to one side; only without hardening
//!
//! # Source
//! J. Lee, J. Mech. Sci. Technol. 27 (2013) 297: lower frequencies with a clamp that gives; factors derived. Damping: Kelvin and Voigt’s element. Unlike sides: bilinear stiffness, Y. C. Chu and M.-H. H. Shen, AIAA J. 30 (1992) 2512.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};
use crate::model::ClampCurve;

/// See the file's head.
pub const CLAMP_COMPLIANCE: Effect = Effect {
    id: "clamp-compliance",
    kind: Kind::Structure,
    cause: "The clamp gives, so the root turns with the moment on it.",
    equation: "φ·(1 + (a·φ)²) + T·φ̇ = c·(1 + u·sign M_root)·M_root",
    source: "J. Lee, J. Mech. Sci. Technol. 27 (2013) 297: lower frequencies with a clamp that gives; factors derived. Damping: Kelvin and Voigt’s element. Unlike sides: bilinear stiffness, Y. C. Chu and M.-H. H. Shen, AIAA J. 30 (1992) 2512.",
    parameters: &[
        Parameter {
            name: "compliance_rad_per_n_m",
            unit: "rad/(N·m)",
            bounds: [0.0, 10.0],
            off: Some(0.0),
            default: None,
            about: "turn c of the root per moment",
        },
        Parameter {
            name: "damping_s",
            unit: "s",
            bounds: [0.0, 1.0],
            off: None,
            default: Some(0.0),
            about: "T: damping of the clamp over its stiffness",
        },
        Parameter {
            name: "hardening_per_rad",
            unit: "1/rad",
            bounds: [0.0, 1e5],
            off: None,
            default: Some(0.0),
            about: "a: a turn of 1/a takes twice the moment of a clamp that does not harden, as where play ends or faces come to bear",
        },
        Parameter {
            name: "asymmetry",
            unit: "",
            bounds: [-1.0, 1.0],
            off: None,
            default: Some(0.0),
            about: "u: the clamp gives by 1 + u times c to a moment that raises the free end, by 1 − u times c to one that lowers it, as where faces open to one side; only without hardening",
        },
    ],
    places: &[Place::Clamp],
    fitting: Fitting::Candidate {
        on: fits::clamped,
        variants: &[
            Form {
                fitted: &[("compliance_rad_per_n_m", 0.5), ("damping_s", 2e-3)],
                starts: &[&[0.2, 2e-3], &[1.0, 2e-3]],
                given: &[],
            },
            Form {
                fitted: &[("compliance_rad_per_n_m", 0.5), ("hardening_per_rad", 200.0)],
                starts: &[&[0.5, 200.0], &[2.0, 200.0], &[2.0, 1000.0]],
                given: &[],
            },
            Form {
                fitted: &[("compliance_rad_per_n_m", 0.5), ("asymmetry", 0.5)],
                starts: &[&[0.2, 0.5], &[0.2, -0.5], &[1.0, 0.5], &[1.0, -0.5]],
                given: &[],
            },
        ],
        forms: &[Form { fitted: &[("compliance_rad_per_n_m", 0.5)], starts: &[&[0.2], &[1.0]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| {
        match p[3] {
            0.0 => robot.extensions.clamp_compliance += 1e-7 * p[0],
            asymmetry => robot.extensions.clamp_curve = ClampCurve::bilinear(1e-7 * p[0], asymmetry),
        }
        robot.extensions.clamp_damping += p[1];
        robot.extensions.clamp_hardening = p[2];
    }),
};
