//! Springs beside the joints slip at a moment: friction that begins with elastic presliding.
//!
//! ```text
//! τ = −k·(θ − θ_V + η·θ̇) − Σ M_j h_j/κ_j,  ḣ_j = θ̇/ℓ within ±κ_j
//! ```
//!
//! # Parameters
//! * `range_per_m` (1/m): curvature at which the last spring slips; each of the others slips at a third of the next
//! * `moment_1_mn_m` (mN·m): moment at which spring 1 slips
//! * `moment_2_mn_m` (mN·m): moment at which spring 2 slips
//! * `moment_3_mn_m` (mN·m): moment at which spring 3 slips
//! * `moment_4_mn_m` (mN·m): moment at which spring 4 slips
//! * `moment_5_mn_m` (mN·m): moment at which spring 5 slips
//!
//! # Source
//! Iwan, J. Appl. Mech. 33 (1966) 893: springs and slips in parallel.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape, fits};
use crate::model::Slip;

/// See the file's head.
pub const FREE_JOINT_SLIP: Effect = Effect {
    id: "free-joint-slip",
    kind: Kind::Structure,
    cause: "Springs beside the joints slip at a moment: friction that begins with elastic presliding.",
    equation: "τ = −k·(θ − θ_V + η·θ̇) − Σ M_j h_j/κ_j,  ḣ_j = θ̇/ℓ within ±κ_j",
    source: "Iwan, J. Appl. Mech. 33 (1966) 893: springs and slips in parallel.",
    parameters: &[
        Parameter {
            name: "range_per_m",
            unit: "1/m",
            bounds: [1e-6, 1e4],
            off: None,
            default: Some(5.0),
            about: "curvature at which the last spring slips; each of the others slips at a third of the next",
        },
        Parameter {
            name: "moment_1_mn_m",
            unit: "mN·m",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "moment at which spring 1 slips",
        },
        Parameter {
            name: "moment_2_mn_m",
            unit: "mN·m",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "moment at which spring 2 slips",
        },
        Parameter {
            name: "moment_3_mn_m",
            unit: "mN·m",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "moment at which spring 3 slips",
        },
        Parameter {
            name: "moment_4_mn_m",
            unit: "mN·m",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "moment at which spring 4 slips",
        },
        Parameter {
            name: "moment_5_mn_m",
            unit: "mN·m",
            bounds: [0.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "moment at which spring 5 slips",
        },
    ],
    places: &[Place::JointMemory],
    fitting: Fitting::Candidate {
        on: fits::any,
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
        x: "curvature at slip",
        x_unit: "1/m",
        y: "moment at slip",
        y_unit: "mN·m",
        points: |p| slips(p).map(|slip| [100.0 * slip.curvature, 1e-4 * slip.moment]).collect(),
    }),
    action: Action::Robot(|p, robot| robot.extensions.slips.extend(slips(p).filter(|slip| slip.moment > 0.0))),
};

fn slips(p: &[f64]) -> impl Iterator<Item = Slip> {
    let [range, moments @ ..] = p else { unreachable!("the range is a parameter") };
    let range = 0.01 * range;
    moments.iter().rev().scan(range, |curvature, moment| {
        let slip = Slip { moment: 1e4 * moment, curvature: *curvature };
        *curvature /= 3.0;
        Some(slip)
    })
}
