//! The joints relax with other times.
//!
//! ```text
//! τ = −k·(θ − θ_V + η·θ̇ + Σ ξ_j q_j),  q̇_j = θ̇ − q_j/T_j
//! ```
//!
//! # Parameters
//! * `share_1` (–): ξ of the unit with T = 1e-4 s, as a share of a joint’s stiffness
//! * `share_2` (–): ξ of the unit with T = 1e-3 s, as a share of a joint’s stiffness
//! * `share_3` (–): ξ of the unit with T = 0.01 s, as a share of a joint’s stiffness
//! * `share_4` (–): ξ of the unit with T = 0.1 s, as a share of a joint’s stiffness
//! * `share_5` (–): ξ of the unit with T = 1 s, as a share of a joint’s stiffness
//!
//! # Source
//! Generalised Maxwell chain: Tschoegl, The Phenomenological Theory of Linear Viscoelastic Behavior, 1989.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape, fits};
use crate::model::LOSS_TIMES;

/// See the file's head.
pub const FREE_JOINT_MEMORY: Effect = Effect {
    id: "free-joint-memory",
    kind: Kind::Structure,
    cause: "The joints relax with other times.",
    equation: "τ = −k·(θ − θ_V + η·θ̇ + Σ ξ_j q_j),  q̇_j = θ̇ − q_j/T_j",
    source: "Generalised Maxwell chain: Tschoegl, The Phenomenological Theory of Linear Viscoelastic Behavior, 1989.",
    parameters: &[
        Parameter {
            name: "share_1",
            unit: "",
            bounds: [0.0, 2.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "ξ of the unit with T = 1e-4 s, as a share of a joint’s stiffness",
        },
        Parameter {
            name: "share_2",
            unit: "",
            bounds: [0.0, 2.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "ξ of the unit with T = 1e-3 s, as a share of a joint’s stiffness",
        },
        Parameter {
            name: "share_3",
            unit: "",
            bounds: [0.0, 2.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "ξ of the unit with T = 0.01 s, as a share of a joint’s stiffness",
        },
        Parameter {
            name: "share_4",
            unit: "",
            bounds: [0.0, 2.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "ξ of the unit with T = 0.1 s, as a share of a joint’s stiffness",
        },
        Parameter {
            name: "share_5",
            unit: "",
            bounds: [0.0, 2.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "ξ of the unit with T = 1 s, as a share of a joint’s stiffness",
        },
    ],
    places: &[Place::JointMemory],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form {
            fitted: &[("share_1", 0.02), ("share_2", 0.02), ("share_3", 0.02), ("share_4", 0.02), ("share_5", 0.02)],
            starts: &[
                &[0.02, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.02, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.02, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.02, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.02],
            ],
            given: &[],
        }],
    },
    shape: Some(Shape {
        x: "relaxation time",
        x_unit: "s",
        y: "share of the stiffness",
        y_unit: "",
        points: |p| LOSS_TIMES.into_iter().zip(p).map(|(t, share)| [t, *share]).collect(),
    }),
    action: Action::Robot(|p, robot| robot.extensions.loss.iter_mut().zip(p).for_each(|(share, p)| *share += p)),
};
