//! The clamp gives, so the root shifts vertically with the force on it.
//!
//! ```text
//! z_root + T·ż_root = c·F_root
//! ```
//!
//! F_root is the vertical force of the sheet on the clamp, with its weight and its inertia; the root has no shift without it.
//!
//! # Parameters
//! * `compliance_mm_per_n` (mm/N): shift c of the root per force
//! * `damping_s` (s): T: damping of the clamp over its stiffness
//!
//! # Source
//! Elastic supports of beams: Gorman, Free Vibration Analysis of Beams and Shafts, 1975. Damping: Kelvin and Voigt’s element.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const CLAMP_SHIFT: Effect = Effect {
    id: "clamp-shift",
    kind: Kind::Structure,
    cause: "The clamp gives, so the root shifts vertically with the force on it.",
    equation: "z_root + T·ż_root = c·F_root",
    source: "Elastic supports of beams: Gorman, Free Vibration Analysis of Beams and Shafts, 1975. Damping: Kelvin and Voigt’s element.",
    parameters: &[
        Parameter {
            name: "compliance_mm_per_n",
            unit: "mm/N",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: None,
            about: "shift c of the root per force",
        },
        Parameter {
            name: "damping_s",
            unit: "s",
            bounds: [0.0, 1.0],
            off: None,
            default: Some(0.0),
            about: "T: damping of the clamp over its stiffness",
        },
    ],
    places: &[Place::Clamp],
    fitting: Fitting::Candidate {
        on: fits::clamped,
        variants: &[Form {
            fitted: &[("compliance_mm_per_n", 1.0), ("damping_s", 2e-3)],
            starts: &[&[1.0, 2e-3], &[5.0, 2e-3]],
            given: &[],
        }],
        forms: &[Form { fitted: &[("compliance_mm_per_n", 1.0)], starts: &[&[1.0], &[5.0]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| {
        // 1 mm/N is 10⁻⁶ cm/dyn.
        robot.extensions.clamp_shift += 1e-6 * p[0];
        robot.extensions.clamp_shift_damping = p[1];
    }),
};
