//! The ends of each patch carry no electrodes and do not bend by voltage.
//!
//! ```text
//! γ(s) = γ for p·L/2 < s < L − p·L/2, else 0; joint i gets its share of active length
//! ```
//!
//! # Parameters
//! * `fraction` (–): share p of an actuator’s length that is passive, half of it at each end
//!
//! # Source
//! Geometry of the M-8514 patch, by inference; derived.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const PASSIVE_MARGIN: Effect = Effect {
    id: "passive-margin",
    kind: Kind::Actuation,
    cause: "The ends of each patch carry no electrodes and do not bend by voltage.",
    equation: "γ(s) = γ for p·L/2 < s < L − p·L/2, else 0; joint i gets its share of active length",
    source: "Geometry of the M-8514 patch, by inference; derived.",
    parameters: &[Parameter {
        name: "fraction",
        unit: "",
        bounds: [0.0, 0.6],
        off: Some(0.0),
        default: None,
        about: "share p of an actuator’s length that is passive, half of it at each end",
    }],
    places: &[Place::GainAlong],
    fitting: Fitting::Candidate {
        on: fits::shape,
        forms: &[Form { fitted: &[("fraction", 0.05)], starts: &[&[0.08]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| {
        let (joints, m) = (robot.joints(), robot.motors_per_actuator);
        robot.extensions.joint_gains.resize(joints, 1.0);
        for (i, gain) in robot.extensions.joint_gains.iter_mut().enumerate() {
            // Joint i stands for the piece from i/m to (i + 1)/m of its actuator.
            let (from, to) = ((i % m) as f64 / m as f64, (i % m + 1) as f64 / m as f64);
            let active = to.min(1.0 - 0.5 * p[0]) - from.max(0.5 * p[0]);
            *gain *= active.max(0.0) * m as f64;
        }
    }),
};
