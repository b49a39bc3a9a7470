//! A wire, solder or a marker adds a mass at a point of the sheet.
//!
//! ```text
//! Δf/f ≈ −(m_a/2M)·φ(s)²,  −2·m_a/M at the tip of a cantilever
//! ```
//!
//! # Parameters
//! * `mass_g` (g): the mass
//! * `position_mm` (mm): distance from the left end along the sheet; by default the right end
//!
//! # Source
//! Derived (Rayleigh quotient).

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};
use crate::model::PointMass;

/// See the file's head.
pub const TIP_MASS: Effect = Effect {
    id: "tip-mass",
    kind: Kind::Structure,
    cause: "A wire, solder or a marker adds a mass at a point of the sheet.",
    equation: "Δf/f ≈ −(m_a/2M)·φ(s)²,  −2·m_a/M at the tip of a cantilever",
    source: "Derived (Rayleigh quotient).",
    parameters: &[
        Parameter { name: "mass_g", unit: "g", bounds: [0.0, 2.0], off: Some(0.0), default: None, about: "the mass" },
        Parameter {
            name: "position_mm",
            unit: "mm",
            bounds: [0.0, 1e5],
            off: None,
            default: Some(f64::INFINITY),
            about: "distance from the left end along the sheet; by default the right end",
        },
    ],
    places: &[Place::Mass],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form { fitted: &[("mass_g", 0.1)], starts: &[&[0.05], &[0.2]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| {
        let end = robot.material.actuator_length * robot.actuators as f64;
        robot.extensions.point_masses.push(PointMass { mass: p[0], position: (0.1 * p[1]).min(end) });
    }),
};
