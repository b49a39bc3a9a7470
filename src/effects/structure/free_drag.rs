//! The air’s force follows another curve of the sheet’s normal speed.
//!
//! ```text
//! f = −½·ρ·w·v·(C₁·v₀ + C₂·|v| + C₃·v²/v₀),  v₀ = 1 m/s
//! ```
//!
//! # Parameters
//! * `linear` (–): C₁: drag that grows with the speed
//! * `quadratic` (–): C₂: drag that grows with the square of the speed
//! * `cubic` (–): C₃: drag that grows with the cube of the speed
//!
//! # Source
//! Derived.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape, fits};

/// See the file's head.
pub const FREE_DRAG: Effect = Effect {
    id: "free-drag",
    kind: Kind::Structure,
    cause: "The air’s force follows another curve of the sheet’s normal speed.",
    equation: "f = −½·ρ·w·v·(C₁·v₀ + C₂·|v| + C₃·v²/v₀),  v₀ = 1 m/s",
    source: "Derived.",
    parameters: &[
        Parameter {
            name: "linear",
            unit: "",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "C₁: drag that grows with the speed",
        },
        Parameter {
            name: "quadratic",
            unit: "",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "C₂: drag that grows with the square of the speed",
        },
        Parameter {
            name: "cubic",
            unit: "",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "C₃: drag that grows with the cube of the speed",
        },
    ],
    places: &[Place::Air],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form {
            fitted: &[("linear", 1.0), ("quadratic", 1.0), ("cubic", 1.0)],
            starts: &[&[1.0, 0.0, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0]],
            given: &[],
        }],
    },
    shape: Some(Shape {
        x: "normal speed",
        x_unit: "m/s",
        y: "coefficient of drag",
        y_unit: "",
        points: |p| (1..=10).map(|k| 0.2 * f64::from(k)).map(|v| [v, p[0] / v + p[1] + p[2] * v]).collect(),
    }),
    action: Action::Robot(|p, robot| robot.extensions.drag.iter_mut().zip(p).for_each(|(part, p)| *part += p)),
};
