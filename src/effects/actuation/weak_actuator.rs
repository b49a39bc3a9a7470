//! One actuator is partly depoled, debonded, or has broken electrodes.
//!
//! ```text
//! θ_V = −s·γ·ℓ·V for the joints of one actuator
//! ```
//!
//! # Parameters
//! * `actuator` (–): the actuator, from 1
//! * `gain` (–): remaining gain
//!
//! # Source
//! From general knowledge.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const WEAK_ACTUATOR: Effect = Effect {
    id: "weak-actuator",
    kind: Kind::Actuation,
    cause: "One actuator is partly depoled, debonded, or has broken electrodes.",
    equation: "θ_V = −s·γ·ℓ·V for the joints of one actuator",
    source: "From general knowledge.",
    parameters: &[
        Parameter { name: "actuator", unit: "", bounds: [1.0, 1e4], off: None, default: None, about: "the actuator, from 1" },
        Parameter { name: "gain", unit: "", bounds: [0.0, 1.5], off: Some(1.0), default: None, about: "remaining gain" },
    ],
    places: &[Place::GainAlong],
    fitting: Fitting::Candidate {
        on: fits::several_actuators,
        forms: &[Form { fitted: &[("gain", 0.1)], starts: &[&[0.95]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| {
        let (joints, m) = (robot.joints(), robot.motors_per_actuator);
        robot.extensions.joint_gains.resize(joints, 1.0);
        let first = (p[0] as usize).saturating_sub(1) * m;
        robot.extensions.joint_gains.iter_mut().skip(first).take(m).for_each(|gain| *gain *= p[1]);
    }),
};
