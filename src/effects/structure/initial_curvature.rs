//! The sheet is not flat at 0 V, from curing warm with unlike layers or from handling.
//!
//! ```text
//! τ = −k·(θ − θ_V − κ₀·ℓ + η·θ̇)
//! ```
//!
//! # Parameters
//! * `curvature_per_m` (1/m): curvature κ₀; positive bends the right end down
//! * `actuator` (–): the actuator, from 1; 0: all of them
//!
//! # Source
//! Cure temperature: Smart Material FAQ; equation derived.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const INITIAL_CURVATURE: Effect = Effect {
    id: "initial-curvature",
    kind: Kind::Structure,
    cause: "The sheet is not flat at 0 V, from curing warm with unlike layers or from handling.",
    equation: "τ = −k·(θ − θ_V − κ₀·ℓ + η·θ̇)",
    source: "Cure temperature: Smart Material FAQ; equation derived.",
    parameters: &[
        Parameter {
            name: "curvature_per_m",
            unit: "1/m",
            bounds: [-5.0, 5.0],
            off: Some(0.0),
            default: None,
            about: "curvature κ₀; positive bends the right end down",
        },
        Parameter {
            name: "actuator",
            unit: "",
            bounds: [0.0, 1e4],
            off: None,
            default: Some(0.0),
            about: "the actuator, from 1; 0: all of them",
        },
    ],
    places: &[Place::RestShape],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form { fitted: &[("curvature_per_m", 0.2)], starts: &[&[0.1]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| {
        let curvature = &mut robot.extensions.rest_curvature;
        curvature.resize(robot.actuators, 0.0);
        let chosen = |i: usize| p[1] == 0.0 || p[1] == (i + 1) as f64;
        curvature.iter_mut().enumerate().filter(|(i, _)| chosen(*i)).for_each(|(_, curvature)| *curvature += 0.01 * p[0]);
    }),
};
