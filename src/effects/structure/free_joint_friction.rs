//! Dry friction in the joints depends on how far they are bent.
//!
//! ```text
//! τ = −k·(θ − θ_V + η·θ̇) − M(|θ|/ℓ)·tanh(θ̇/ω_ε)
//! ```
//!
//! # Parameters
//! * `bend_range_per_m` (1/m): largest curvature of the curve
//! * `moment_1_mn_m` (mN·m): M without curvature
//! * `moment_2_mn_m` (mN·m): M at 1/5 of the range
//! * `moment_3_mn_m` (mN·m): M at 2/5 of the range
//! * `moment_4_mn_m` (mN·m): M at 3/5 of the range
//! * `moment_5_mn_m` (mN·m): M at 4/5 of the range
//! * `moment_6_mn_m` (mN·m): M at 5/5 of the range
//!
//! # Source
//! Restoring-force surface: Masri and Caughey, J. Appl. Mech. 46 (1979) 433; cubic through points: Catmull and Rom 1974.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape, curve::points, fits};
use crate::model::{CURVE_POINTS, Curve};

/// See the file's head.
pub const FREE_JOINT_FRICTION: Effect = Effect {
    id: "free-joint-friction",
    kind: Kind::Structure,
    cause: "Dry friction in the joints depends on how far they are bent.",
    equation: "τ = −k·(θ − θ_V + η·θ̇) − M(|θ|/ℓ)·tanh(θ̇/ω_ε)",
    source: "Restoring-force surface: Masri and Caughey, J. Appl. Mech. 46 (1979) 433; cubic through points: Catmull and Rom 1974.",
    parameters: &[
        Parameter {
            name: "bend_range_per_m",
            unit: "1/m",
            bounds: [1e-3, 1e4],
            off: None,
            default: Some(10.0),
            about: "largest curvature of the curve",
        },
        Parameter {
            name: "moment_1_mn_m",
            unit: "mN·m",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M without curvature",
        },
        Parameter {
            name: "moment_2_mn_m",
            unit: "mN·m",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 1/5 of the range",
        },
        Parameter {
            name: "moment_3_mn_m",
            unit: "mN·m",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 2/5 of the range",
        },
        Parameter {
            name: "moment_4_mn_m",
            unit: "mN·m",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 3/5 of the range",
        },
        Parameter {
            name: "moment_5_mn_m",
            unit: "mN·m",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 4/5 of the range",
        },
        Parameter {
            name: "moment_6_mn_m",
            unit: "mN·m",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 5/5 of the range",
        },
    ],
    places: &[Place::JointMomentOfRate, Place::JointMemory],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[],
        forms: &[Form {
            fitted: &[
                ("moment_1_mn_m", 0.1),
                ("moment_2_mn_m", 0.1),
                ("moment_3_mn_m", 0.1),
                ("moment_4_mn_m", 0.1),
                ("moment_5_mn_m", 0.1),
                ("moment_6_mn_m", 0.1),
            ],
            starts: &[
                &[0.1, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.1, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.1, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.1, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.1, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.1],
            ],
            given: &[],
        }],
    },
    shape: Some(Shape {
        x: "curvature",
        x_unit: "1/m",
        y: "moment of dry friction",
        y_unit: "mN·m",
        points: |p| points(&more(p[0], p, 1.0)).into_iter().map(|[x, y]| [x, (y + p[1]).max(0.0)]).collect(),
    }),
    action: Action::Robot(|p, robot| {
        robot.extensions.dry_friction += 1e4 * p[1];
        robot.extensions.friction_of_curvature = more(0.01 * p[0], p, 1e4);
    }),
};

/// The curve up to `end` of what the moments `p[2..]` are more than that without curvature, `p[1]`, times `factor`.
fn more(end: f64, p: &[f64], factor: f64) -> Curve {
    let more = std::array::from_fn(|k| factor * (p[k + 2] - p[1]));
    Curve::equidistant([0.0, end], [[0.0; CURVE_POINTS], more])
}
