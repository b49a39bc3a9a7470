//! The joints’ moment follows another curve of their rate.
//!
//! ```text
//! τ = −k·(θ − θ_V + η·θ̇) − M(θ̇/ℓ),  M odd
//! ```
//!
//! # Parameters
//! * `range_per_m_s` (1/(m·s)): largest rate of curvature of the curve
//! * `moment_1_mn_m` (mN·m): M at point 1 of 5, equidistant in asinh(30·rate/range)
//! * `moment_2_mn_m` (mN·m): M at point 2 of 5, equidistant in asinh(30·rate/range)
//! * `moment_3_mn_m` (mN·m): M at point 3 of 5, equidistant in asinh(30·rate/range)
//! * `moment_4_mn_m` (mN·m): M at point 4 of 5, equidistant in asinh(30·rate/range)
//! * `moment_5_mn_m` (mN·m): M at point 5 of 5, equidistant in asinh(30·rate/range)
//!
//! # Source
//! Restoring-force surface: Masri and Caughey, J. Appl. Mech. 46 (1979) 433; cubic through points: Catmull and Rom 1974.

use crate::effects::{
    Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape,
    curve::{odd, points},
    fits,
};

/// See the file's head.
pub const FREE_MOMENT_OF_RATE: Effect = Effect {
    id: "free-moment-of-rate",
    kind: Kind::Structure,
    cause: "The joints’ moment follows another curve of their rate.",
    equation: "τ = −k·(θ − θ_V + η·θ̇) − M(θ̇/ℓ),  M odd",
    source: "Restoring-force surface: Masri and Caughey, J. Appl. Mech. 46 (1979) 433; cubic through points: Catmull and Rom 1974.",
    parameters: &[
        Parameter {
            name: "range_per_m_s",
            unit: "1/(m·s)",
            bounds: [1e-3, 1e6],
            off: None,
            default: Some(500.0),
            about: "largest rate of curvature of the curve",
        },
        Parameter {
            name: "moment_1_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at point 1 of 5, equidistant in asinh(30·rate/range)",
        },
        Parameter {
            name: "moment_2_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at point 2 of 5, equidistant in asinh(30·rate/range)",
        },
        Parameter {
            name: "moment_3_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at point 3 of 5, equidistant in asinh(30·rate/range)",
        },
        Parameter {
            name: "moment_4_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at point 4 of 5, equidistant in asinh(30·rate/range)",
        },
        Parameter {
            name: "moment_5_mn_m",
            unit: "mN·m",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "M at point 5 of 5, equidistant in asinh(30·rate/range)",
        },
    ],
    places: &[Place::JointMomentOfRate],
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
            ],
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
        x: "rate of curvature",
        x_unit: "1/(m·s)",
        y: "additional moment",
        y_unit: "mN·m",
        points: |p| points(&odd(p[0], &p[1..], 1.0)),
    }),
    action: Action::Robot(|p, robot| robot.extensions.moment_of_rate = odd(0.01 * p[0], &p[1..], 1e4)),
};
