//! The gain differs along the robot: with five actuators, from one to the next.
//!
//! ```text
//! θ_V = −(1 + g_j)·γ·ℓ·V for the joints in fifth j of the length
//! ```
//!
//! # Parameters
//! * `change_1` (–): change of the gain in fifth 1 of the length
//! * `change_2` (–): change of the gain in fifth 2 of the length
//! * `change_3` (–): change of the gain in fifth 3 of the length
//! * `change_4` (–): change of the gain in fifth 4 of the length
//! * `change_5` (–): change of the gain in fifth 5 of the length
//!
//! # Source
//! Derived.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape, fits};

/// See the file's head.
pub const FREE_GAIN_ALONG: Effect = Effect {
    id: "free-gain-along",
    kind: Kind::Actuation,
    cause: "The gain differs along the robot: with five actuators, from one to the next.",
    equation: "θ_V = −(1 + g_j)·γ·ℓ·V for the joints in fifth j of the length",
    source: "Derived.",
    parameters: &[
        Parameter {
            name: "change_1",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change of the gain in fifth 1 of the length",
        },
        Parameter {
            name: "change_2",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change of the gain in fifth 2 of the length",
        },
        Parameter {
            name: "change_3",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change of the gain in fifth 3 of the length",
        },
        Parameter {
            name: "change_4",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change of the gain in fifth 4 of the length",
        },
        Parameter {
            name: "change_5",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change of the gain in fifth 5 of the length",
        },
    ],
    places: &[Place::GainAlong],
    fitting: Fitting::Candidate {
        on: fits::shape,
        variants: &[],
        forms: &[Form {
            fitted: &[("change_1", 0.05), ("change_2", 0.05), ("change_3", 0.05), ("change_4", 0.05), ("change_5", 0.05)],
            starts: &[
                &[0.1, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.1, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.1, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.1, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.1],
            ],
            given: &[],
        }],
    },
    shape: Some(Shape {
        x: "share of the length",
        x_unit: "",
        y: "change of the gain",
        y_unit: "",
        points: |p| p.iter().enumerate().map(|(k, change)| [0.2 * (k as f64 + 0.5), *change]).collect(),
    }),
    action: Action::Robot(|p, robot| {
        let joints = robot.joints();
        robot.extensions.joint_gains.resize(joints, 1.0);
        for (joint, gain) in robot.extensions.joint_gains.iter_mut().enumerate() {
            let fifth = ((joint as f64 + 0.5) / joints as f64 * p.len() as f64) as usize;
            *gain *= 1.0 + p[fifth];
        }
    }),
};
