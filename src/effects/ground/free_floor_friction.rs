//! Friction on the floor is another curve of the slip speed.
//!
//! ```text
//! |F_t| ≤ (1 + f(|v|))·μ_link·μ_ground·N, f linear between its points, constant beyond
//! ```
//!
//! Equal weights are the law of `ground-friction`. A viscous force per link, as in `stick-slip`, is none of its laws: it does not grow with N. Both engines take
//! the speed at the start of a step.
//!
//! # Parameters
//! * `range_mm_s` (mm/s): largest slip speed of the curve
//! * `change_1` (–): change f of the coefficient at 0
//! * `change_2` (–): change f of the coefficient at 1/27 of the range
//! * `change_3` (–): change f of the coefficient at 1/9 of the range
//! * `change_4` (–): change f of the coefficient at 1/3 of the range
//! * `change_5` (–): change f of the coefficient at the range and beyond
//!
//! # Source
//! Derived; friction as a curve of speed: Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape, fits};
use crate::model::FrictionCurve;

/// See the file's head.
pub const FREE_FLOOR_FRICTION: Effect = Effect {
    id: "free-floor-friction",
    kind: Kind::Ground,
    cause: "Friction on the floor is another curve of the slip speed.",
    equation: "|F_t| ≤ (1 + f(|v|))·μ_link·μ_ground·N, f linear between its points, constant beyond",
    source: "Derived; friction as a curve of speed: Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083.",
    parameters: &[
        Parameter {
            name: "range_mm_s",
            unit: "mm/s",
            bounds: [1e-3, 1e6],
            off: None,
            default: Some(100.0),
            about: "largest slip speed of the curve",
        },
        Parameter {
            name: "change_1",
            unit: "",
            bounds: [-1.0, 4.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change f of the coefficient at 0",
        },
        Parameter {
            name: "change_2",
            unit: "",
            bounds: [-1.0, 4.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change f of the coefficient at 1/27 of the range",
        },
        Parameter {
            name: "change_3",
            unit: "",
            bounds: [-1.0, 4.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change f of the coefficient at 1/9 of the range",
        },
        Parameter {
            name: "change_4",
            unit: "",
            bounds: [-1.0, 4.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change f of the coefficient at 1/3 of the range",
        },
        Parameter {
            name: "change_5",
            unit: "",
            bounds: [-1.0, 4.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "change f of the coefficient at the range and beyond",
        },
    ],
    places: &[Place::FloorFriction],
    fitting: Fitting::Candidate {
        on: fits::on_the_floor,
        variants: &[],
        forms: &[Form {
            fitted: &[("change_1", 0.1), ("change_2", 0.1), ("change_3", 0.1), ("change_4", 0.1), ("change_5", 0.1)],
            starts: &[
                &[0.1, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.1, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.1, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.1, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.1],
            ],
            given: &[],
        }],
    },
    shape: Some(Shape {
        x: "slip speed",
        x_unit: "mm/s",
        y: "change of the coefficient of friction",
        y_unit: "",
        points: |p| curve(p).points().map(|[speed, change]| [10.0 * speed, change]).to_vec(),
    }),
    action: Action::Robot(|p, robot| robot.extensions.friction_of_speed = curve(p)),
};

fn curve(p: &[f64]) -> FrictionCurve {
    FrictionCurve::new(0.1 * p[0], std::array::from_fn(|k| p[k + 1]))
}
