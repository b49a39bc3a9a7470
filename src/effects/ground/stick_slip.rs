//! Static friction exceeds sliding friction, and sliding friction depends on speed.
//!
//! ```text
//! F = −(μ_c + (μ_s − μ_c)·exp(−(v/v_s)²))·N·sgn(v) − F_v·v
//! ```
//!
//! # Parameters
//! * `static_ratio` (–): static over sliding friction
//! * `stribeck_speed_mm_s` (mm/s): speed v_s
//! * `viscous_mn_s_per_m` (mN·s/m): viscous force F_v per speed and link on the floor
//!
//! # Source
//! Stribeck friction: Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};
use crate::model::StickSlip;

/// See the file's head.
pub const STICK_SLIP: Effect = Effect {
    id: "stick-slip",
    kind: Kind::Ground,
    cause: "Static friction exceeds sliding friction, and sliding friction depends on speed.",
    equation: "F = −(μ_c + (μ_s − μ_c)·exp(−(v/v_s)²))·N·sgn(v) − F_v·v",
    source: "Stribeck friction: Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083.",
    parameters: &[
        Parameter {
            name: "static_ratio",
            unit: "",
            bounds: [1.0, 3.0],
            off: Some(1.0),
            default: Some(1.0),
            about: "static over sliding friction",
        },
        Parameter {
            name: "stribeck_speed_mm_s",
            unit: "mm/s",
            bounds: [1.0, 50.0],
            off: None,
            default: Some(10.0),
            about: "speed v_s",
        },
        Parameter {
            name: "viscous_mn_s_per_m",
            unit: "mN·s/m",
            bounds: [0.0, 50.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "viscous force F_v per speed and link on the floor",
        },
    ],
    places: &[Place::FloorFriction],
    fitting: Fitting::Candidate {
        on: fits::on_the_floor,
        forms: &[Form { fitted: &[("static_ratio", 0.2)], starts: &[&[1.2]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| robot.extensions.stick_slip = StickSlip { ratio: p[0], speed: 0.1 * p[1], viscous: p[2] }),
};
