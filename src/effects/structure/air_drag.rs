//! The sheet pushes air; the force grows with the square of the speed.
//!
//! ```text
//! f = −½·ρ·C_d·w·v·(|v|·(|v|/1 m/s)^(p − 2) + v₁),  v normal to the sheet
//! ```
//!
//! # Parameters
//! * `drag_coefficient` (–): drag coefficient C_d, with another exponent than 2 that at 1 m/s
//! * `exponent` (–): power p of the speed
//! * `linear_m_per_s` (m/s): v₁: speed at which a part in proportion to the speed is as large as a quadratic one
//!
//! # Source
//! Textbook drag of a plate; sizes derived. Between 1 (Stokes) and 2: Schlichting, Boundary-Layer Theory; sums of both: White, Viscous Fluid Flow.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const AIR_DRAG: Effect = Effect {
    id: "air-drag",
    kind: Kind::Structure,
    cause: "The sheet pushes air; the force grows with the square of the speed.",
    equation: "f = −½·ρ·C_d·w·v·(|v|·(|v|/1 m/s)^(p − 2) + v₁),  v normal to the sheet",
    source: "Textbook drag of a plate; sizes derived. Between 1 (Stokes) and 2: Schlichting, Boundary-Layer Theory; sums of both: White, Viscous Fluid Flow.",
    parameters: &[
        Parameter {
            name: "drag_coefficient",
            unit: "",
            bounds: [0.0, 40.0],
            off: Some(0.0),
            default: None,
            about: "drag coefficient C_d, with another exponent than 2 that at 1 m/s",
        },
        Parameter {
            name: "exponent",
            unit: "",
            bounds: [0.5, 4.0],
            off: None,
            default: Some(2.0),
            about: "power p of the speed",
        },
        Parameter {
            name: "linear_m_per_s",
            unit: "m/s",
            bounds: [0.0, 100.0],
            off: None,
            default: Some(0.0),
            about: "v₁: speed at which a part in proportion to the speed is as large as a quadratic one",
        },
    ],
    places: &[Place::Air],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[
            Form { fitted: &[("drag_coefficient", 1.0), ("exponent", 0.3)], starts: &[&[1.0, 1.5], &[4.0, 1.5]], given: &[] },
            Form {
                fitted: &[("drag_coefficient", 1.0), ("linear_m_per_s", 0.5)],
                starts: &[&[1.0, 0.5], &[4.0, 0.5]],
                given: &[],
            },
        ],
        forms: &[Form { fitted: &[("drag_coefficient", 1.0)], starts: &[&[1.0], &[4.0]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| {
        let (coefficient, exponent, linear) = (p[0], p[1], p[2]);
        if exponent == 2.0 {
            robot.extensions.drag[1] += coefficient;
        } else {
            robot.extensions.drag_of_power = [coefficient, exponent];
        }
        // Coefficients are those at 1 m/s.
        robot.extensions.drag[0] += coefficient * linear;
    }),
};
