//! The contact returns part of the energy of an impact.
//!
//! ```text
//! v⁺ = −e·v⁻, from 0.2 cm/s on
//! ```
//!
//! Bullet's v⁻ includes the change by loads within the step, so a foot of mass m (g) under N (dyn) chatters unless N·h/m is below 0.2 cm/s. The
//! planar engine reflects the speed at the beginning of the step.
//!
//! # Parameters
//! * `restitution` (–): share e of the approach speed that is returned
//!
//! # Source
//! Newton's law of impact; the threshold is Bullet's.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const CONTACT_RESTITUTION: Effect = Effect {
    id: "contact-restitution",
    kind: Kind::Ground,
    cause: "The contact returns part of the energy of an impact.",
    equation: "v⁺ = −e·v⁻, from 0.2 cm/s on",
    source: "Newton's law of impact; the threshold is Bullet's.",
    parameters: &[Parameter {
        name: "restitution",
        unit: "",
        bounds: [0.0, 0.9],
        off: Some(0.0),
        default: None,
        about: "share e of the approach speed that is returned",
    }],
    places: &[Place::Impact],
    fitting: Fitting::Candidate {
        on: fits::on_the_floor,
        forms: &[Form { fitted: &[("restitution", 0.1)], starts: &[&[0.1], &[0.4]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| robot.extensions.restitution = p[0]),
};
