//! The stiffness drifts from run to run, as the laminate warms up, creeps or loses its bond.
//!
//! ```text
//! τ = −(1 + q·n)·k·(θ − θ_V + η·θ̇)
//! ```
//!
//! n is the place of a run in the order of measurement, from the mean of all. A diagnosis sets it for each run, from the order of the runs in its data set.
//!
//! # Parameters
//! * `per_run` (1/run): change q of the stiffness from one run to the next
//! * `run` (–): place n of the run from the mean of all
//!
//! # Source
//! The first term of a series in time.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const STIFFNESS_DRIFT: Effect = Effect {
    id: "stiffness-drift",
    kind: Kind::Structure,
    cause: "The stiffness drifts from run to run, as the laminate warms up, creeps or loses its bond.",
    equation: "τ = −(1 + q·n)·k·(θ − θ_V + η·θ̇)",
    source: "The first term of a series in time.",
    parameters: &[
        Parameter {
            name: "per_run",
            unit: "1/run",
            bounds: [-0.1, 0.1],
            off: Some(0.0),
            default: None,
            about: "change q of the stiffness from one run to the next",
        },
        Parameter::run(),
    ],
    places: &[Place::Stiffness],
    fitting: Fitting::Candidate {
        on: fits::several_runs,
        variants: &[],
        forms: &[Form { fitted: &[("per_run", 0.005)], starts: &[&[0.005]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| robot.extensions.stiffness_scale *= 1.0 + p[0] * p[1]),
};
