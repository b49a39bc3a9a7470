//! The stiffness differs along the robot.
//!
//! ```text
//! τ = −(1 + s)·k·(θ − θ_V + η·θ̇), s the mean of s_j over the length that the joint stands for
//! ```
//!
//! A joint that stands for parts of two fifths has the mean of both, weighted by length, so that the weights mean the same with any number of joints.
//!
//! # Parameters
//! * `change_1` (–): change s of the stiffness in fifth 1 of the length, from the left end
//! * `change_2` (–): change s of the stiffness in fifth 2 of the length, from the left end
//! * `change_3` (–): change s of the stiffness in fifth 3 of the length, from the left end
//! * `change_4` (–): change s of the stiffness in fifth 4 of the length, from the left end
//! * `change_5` (–): change s of the stiffness in fifth 5 of the length, from the left end
//!
//! # Source
//! Derived from eq. 1.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape, fits};

/// See the file's head.
pub const FREE_STIFFNESS_ALONG: Effect = Effect {
    id: "free-stiffness-along",
    kind: Kind::Structure,
    cause: "The stiffness differs along the robot.",
    equation: "τ = −(1 + s)·k·(θ − θ_V + η·θ̇), s the mean of s_j over the length that the joint stands for",
    source: "Derived from eq. 1.",
    parameters: &[
        Parameter {
            name: "change_1",
            unit: "",
            bounds: [-0.9, 4.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change s of the stiffness in fifth 1 of the length, from the left end",
        },
        Parameter {
            name: "change_2",
            unit: "",
            bounds: [-0.9, 4.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change s of the stiffness in fifth 2 of the length, from the left end",
        },
        Parameter {
            name: "change_3",
            unit: "",
            bounds: [-0.9, 4.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change s of the stiffness in fifth 3 of the length, from the left end",
        },
        Parameter {
            name: "change_4",
            unit: "",
            bounds: [-0.9, 4.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change s of the stiffness in fifth 4 of the length, from the left end",
        },
        Parameter {
            name: "change_5",
            unit: "",
            bounds: [-0.9, 4.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change s of the stiffness in fifth 5 of the length, from the left end",
        },
    ],
    places: &[Place::Stiffness],
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
        y: "change of the stiffness",
        y_unit: "",
        points: |p| p.iter().enumerate().map(|(k, change)| [0.2 * (k as f64 + 0.5), *change]).collect(),
    }),
    action: Action::Robot(|p, robot| {
        let joints = robot.joints();
        robot.extensions.joint_stiffness.resize(joints, 1.0);
        for (joint, factor) in robot.extensions.joint_stiffness.iter_mut().enumerate() {
            *factor *= 1.0 + mean(p, joint as f64 / joints as f64, 1.0 / joints as f64);
        }
    }),
};

/// Mean of `changes`, each of an equal part of the length, over a piece that begins at the share `from` of the length and has the share `length`.
fn mean(changes: &[f64], from: f64, length: f64) -> f64 {
    let parts = changes.len() as f64;
    let overlap = |k: usize| {
        let (low, high) = (k as f64 / parts, (k + 1) as f64 / parts);
        (high.min(from + length) - low.max(from)).max(0.0)
    };
    let add = |[sum, whole]: [f64; 2], (k, change): (usize, &f64)| [sum + overlap(k) * change, whole + overlap(k)];
    let [sum, whole] = changes.iter().enumerate().fold([0.0; 2], add);
    sum / whole
}
