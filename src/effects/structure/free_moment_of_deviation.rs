//! The joints’ moment follows another curve of their elastic deviation.
//!
//! ```text
//! τ = −k·(θ − θ_V + η·θ̇) − M((θ − θ_V)/ℓ)
//! ```
//!
//! # Parameters
//! * `low_per_m` (1/m): lowest elastic curvature of the curve
//! * `high_per_m` (1/m): highest elastic curvature of the curve
//! * `below_1_mn_m` (mN·m): M at 1/5 of the range below 0
//! * `below_2_mn_m` (mN·m): M at 2/5 of the range below 0
//! * `below_3_mn_m` (mN·m): M at 3/5 of the range below 0
//! * `below_4_mn_m` (mN·m): M at 4/5 of the range below 0
//! * `below_5_mn_m` (mN·m): M at 5/5 of the range below 0
//! * `above_1_mn_m` (mN·m): M at 1/5 of the range above 0
//! * `above_2_mn_m` (mN·m): M at 2/5 of the range above 0
//! * `above_3_mn_m` (mN·m): M at 3/5 of the range above 0
//! * `above_4_mn_m` (mN·m): M at 4/5 of the range above 0
//! * `above_5_mn_m` (mN·m): M at 5/5 of the range above 0
//!
//! # Source
//! Restoring-force surface: Masri and Caughey, J. Appl. Mech. 46 (1979) 433; cubic through points: Catmull and Rom 1974.

use crate::effects::{
    Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape,
    curve::{points, two_sided},
    fits,
};
use crate::model::CURVE_POINTS;

/// See the file's head.
pub const FREE_MOMENT_OF_DEVIATION: Effect = Effect {
    id: "free-moment-of-deviation",
    kind: Kind::Structure,
    cause: "The joints’ moment follows another curve of their elastic deviation.",
    equation: "τ = −k·(θ − θ_V + η·θ̇) − M((θ − θ_V)/ℓ)",
    source: "Restoring-force surface: Masri and Caughey, J. Appl. Mech. 46 (1979) 433; cubic through points: Catmull and Rom 1974.",
    parameters: &[
        Parameter {
            name: "low_per_m",
            unit: "1/m",
            bounds: [-1e4, 0.0],
            off: None,
            default: Some(-5.0),
            about: "lowest elastic curvature of the curve",
        },
        Parameter {
            name: "high_per_m",
            unit: "1/m",
            bounds: [0.0, 1e4],
            off: None,
            default: Some(5.0),
            about: "highest elastic curvature of the curve",
        },
        Parameter {
            name: "below_1_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 1/5 of the range below 0",
        },
        Parameter {
            name: "below_2_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 2/5 of the range below 0",
        },
        Parameter {
            name: "below_3_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 3/5 of the range below 0",
        },
        Parameter {
            name: "below_4_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 4/5 of the range below 0",
        },
        Parameter {
            name: "below_5_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 5/5 of the range below 0",
        },
        Parameter {
            name: "above_1_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 1/5 of the range above 0",
        },
        Parameter {
            name: "above_2_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 2/5 of the range above 0",
        },
        Parameter {
            name: "above_3_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 3/5 of the range above 0",
        },
        Parameter {
            name: "above_4_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 4/5 of the range above 0",
        },
        Parameter {
            name: "above_5_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at 5/5 of the range above 0",
        },
    ],
    places: &[Place::JointMomentOfDeviation],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[],
        forms: &[Form {
            fitted: &[
                ("below_1_mn_m", 0.5),
                ("below_2_mn_m", 0.5),
                ("below_3_mn_m", 0.5),
                ("below_4_mn_m", 0.5),
                ("below_5_mn_m", 0.5),
                ("above_1_mn_m", 0.5),
                ("above_2_mn_m", 0.5),
                ("above_3_mn_m", 0.5),
                ("above_4_mn_m", 0.5),
                ("above_5_mn_m", 0.5),
            ],
            starts: &[
                &[0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5],
            ],
            given: &[],
        }],
    },
    shape: Some(Shape {
        x: "elastic curvature",
        x_unit: "1/m",
        y: "additional moment",
        y_unit: "mN·m",
        points: |p| points(&two_sided::<CURVE_POINTS>([-p[0], p[1]], &p[2..], 1.0)),
    }),
    action: Action::Robot(|p, robot| robot.extensions.moment_of_curvature = two_sided([-0.01 * p[0], 0.01 * p[1]], &p[2..], 1e4)),
};
