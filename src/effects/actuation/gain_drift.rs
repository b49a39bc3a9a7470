//! The curvature per volt drifts from run to run, as the actuator ages, depoles or warms up.
//!
//! ```text
//! θ_V = −(1 + q·n)·γ·ℓ·V
//! ```
//!
//! n is the place of a run in the order of measurement, from the mean of all. A diagnosis sets it for each run, from the order of the runs in its data set.
//!
//! # Parameters
//! * `per_run` (1/run): change q of the gain from one run to the next
//! * `run` (–): place n of the run from the mean of all
//!
//! # Source
//! The first term of a series in time; aging of ferroelectrics: Genenko, Glaum, Hoffmann, Albe, Mater. Sci. Eng. B 192 (2015) 52.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const GAIN_DRIFT: Effect = Effect {
    id: "gain-drift",
    kind: Kind::Actuation,
    cause: "The curvature per volt drifts from run to run, as the actuator ages, depoles or warms up.",
    equation: "θ_V = −(1 + q·n)·γ·ℓ·V",
    source: "The first term of a series in time; aging of ferroelectrics: Genenko, Glaum, Hoffmann, Albe, Mater. Sci. Eng. B 192 (2015) 52.",
    parameters: &[
        Parameter {
            name: "per_run",
            unit: "1/run",
            bounds: [-0.1, 0.1],
            off: Some(0.0),
            default: None,
            about: "change q of the gain from one run to the next",
        },
        Parameter::run(),
    ],
    places: &[Place::VoltageCurve],
    fitting: Fitting::Candidate {
        on: fits::several_runs,
        variants: &[],
        forms: &[Form { fitted: &[("per_run", 0.005)], starts: &[&[0.005]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| robot.extensions.gain_scale *= 1.0 + p[0] * p[1]),
};
