//! A tape or cable from a fixed point to the sheet is taut on one side of a height, and pulls, damps and rubs there.
//!
//! ```text
//! F_z = −s·k·g − e·(k·T·ż + f·tanh(ż/1 mm/s)),  g = max(0, s·(z − z_0)),  e = min(1, g/0.1 mm)
//! ```
//!
//! z is the height of a point of the sheet, s = 1 above the level z_0 and −1 below it. Damper and friction set in with g, so that no force jumps (as for
//! contact in Hunt and Crossley). The pull is that of the vertical motion alone: a cable that is long beside what the point moves.
//!
//! # Parameters
//! * `stiffness_n_per_m` (N/m): stiffness k of what is taut
//! * `drag_mn` (mN): force f of friction against the vertical motion
//! * `damping_s` (s): T: damping over stiffness
//! * `level_mm` (mm): height z_0 from which on it is taut
//! * `below` (–): 0: taut above the level; 1: below it, as a cable from above
//! * `position_mm` (mm): distance of the point from the left end along the sheet; by default the right end
//!
//! # Source
//! One-sided spring: Worden and Tomlinson, Nonlinearity in Structural Dynamics, 2001; damping that sets in with it: Hunt and Crossley, J. Appl. Mech. 42 (1975) 440.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};
use crate::model::Attachment;

/// See the file's head.
pub const CABLE_DRAG: Effect = Effect {
    id: "cable-drag",
    kind: Kind::Structure,
    cause: "A tape or cable from a fixed point to the sheet is taut on one side of a height, and pulls, damps and rubs there.",
    equation: "F_z = −s·k·g − e·(k·T·ż + f·tanh(ż/1 mm/s)),  g = max(0, s·(z − z_0)),  e = min(1, g/0.1 mm)",
    source: "One-sided spring: Worden and Tomlinson, Nonlinearity in Structural Dynamics, 2001; damping that sets in with it: Hunt and Crossley, J. Appl. Mech. 42 (1975) 440.",
    parameters: &[
        Parameter {
            name: "stiffness_n_per_m",
            unit: "N/m",
            bounds: [0.0, 1000.0],
            off: Some(0.0),
            default: None,
            about: "stiffness k of what is taut",
        },
        Parameter {
            name: "drag_mn",
            unit: "mN",
            bounds: [0.0, 1000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "force f of friction against the vertical motion",
        },
        Parameter {
            name: "damping_s",
            unit: "s",
            bounds: [0.0, 1.0],
            off: None,
            default: Some(0.0),
            about: "T: damping over stiffness",
        },
        Parameter {
            name: "level_mm",
            unit: "mm",
            bounds: [-1000.0, 1000.0],
            off: None,
            default: Some(0.0),
            about: "height z_0 from which on it is taut",
        },
        Parameter {
            name: "below",
            unit: "",
            bounds: [0.0, 1.0],
            off: None,
            default: Some(1.0),
            about: "0: taut above the level; 1: below it, as a cable from above",
        },
        Parameter {
            name: "position_mm",
            unit: "mm",
            bounds: [0.0, 1e5],
            off: None,
            default: Some(f64::INFINITY),
            about: "distance of the point from the left end along the sheet; by default the right end",
        },
    ],
    places: &[Place::Attachment, Place::RestShape, Place::JointMomentOfRate],
    fitting: Fitting::Candidate {
        on: fits::clamped,
        variants: &[
            Form {
                fitted: &[("stiffness_n_per_m", 2.0), ("level_mm", 2.0), ("drag_mn", 5.0)],
                starts: &[&[2.0, 0.0, 5.0], &[2.0, 5.0, 5.0]],
                given: &[("below", 0.0)],
            },
            Form {
                fitted: &[("stiffness_n_per_m", 2.0), ("level_mm", 2.0), ("drag_mn", 5.0)],
                starts: &[&[2.0, 0.0, 5.0], &[2.0, -5.0, 5.0]],
                given: &[("below", 1.0)],
            },
            Form {
                fitted: &[("stiffness_n_per_m", 2.0), ("level_mm", 2.0), ("damping_s", 0.01)],
                starts: &[&[2.0, 0.0, 0.01], &[2.0, 5.0, 0.01]],
                given: &[("below", 0.0)],
            },
            Form {
                fitted: &[("stiffness_n_per_m", 2.0), ("level_mm", 2.0), ("damping_s", 0.01)],
                starts: &[&[2.0, 0.0, 0.01], &[2.0, -5.0, 0.01]],
                given: &[("below", 1.0)],
            },
        ],
        forms: &[
            Form {
                fitted: &[("stiffness_n_per_m", 2.0), ("level_mm", 2.0)],
                starts: &[&[2.0, 0.0], &[2.0, 5.0]],
                given: &[("below", 0.0)],
            },
            Form {
                fitted: &[("stiffness_n_per_m", 2.0), ("level_mm", 2.0)],
                starts: &[&[2.0, 0.0], &[2.0, -5.0]],
                given: &[("below", 1.0)],
            },
        ],
    },
    shape: None,
    action: Action::Robot(|p, robot| {
        let end = robot.material.actuator_length * robot.actuators as f64;
        robot.extensions.attachments.push(Attachment {
            // N/m is 1000 dyn/cm, mN is 100 dyn.
            stiffness: 1e3 * p[0],
            friction: 100.0 * p[1],
            damping: p[2],
            level: 0.1 * p[3],
            side: if p[4] < 0.5 { 1.0 } else { -1.0 },
            position: (0.1 * p[5]).min(end),
        });
    }),
};
