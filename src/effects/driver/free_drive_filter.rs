//! The driver follows its command through another linear filter.
//!
//! ```text
//! V_a = V + Σ w_j (q_j − V),  q̇_j = (V − q_j)/T_j
//! ```
//!
//! # Parameters
//! * `share_1` (–): weight of the lag with T = 0.3 ms
//! * `share_2` (–): weight of the lag with T = 1 ms
//! * `share_3` (–): weight of the lag with T = 3 ms
//! * `share_4` (–): weight of the lag with T = 10 ms
//! * `share_5` (–): weight of the lag with T = 30 ms
//!
//! # Source
//! Expansion of a filter in first-order lags: Ljung, System Identification, 1999.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape, driver::Lags, fits};

/// See the file's head.
pub const FREE_DRIVE_FILTER: Effect = Effect {
    id: "free-drive-filter",
    kind: Kind::Driver,
    cause: "The driver follows its command through another linear filter.",
    equation: "V_a = V + Σ w_j (q_j − V),  q̇_j = (V − q_j)/T_j",
    source: "Expansion of a filter in first-order lags: Ljung, System Identification, 1999.",
    parameters: &[
        Parameter {
            name: "share_1",
            unit: "",
            bounds: [-10.0, 10.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the lag with T = 0.3 ms",
        },
        Parameter {
            name: "share_2",
            unit: "",
            bounds: [-10.0, 10.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the lag with T = 1 ms",
        },
        Parameter {
            name: "share_3",
            unit: "",
            bounds: [-10.0, 10.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the lag with T = 3 ms",
        },
        Parameter {
            name: "share_4",
            unit: "",
            bounds: [-10.0, 10.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the lag with T = 10 ms",
        },
        Parameter {
            name: "share_5",
            unit: "",
            bounds: [-10.0, 10.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the lag with T = 30 ms",
        },
    ],
    places: &[Place::Drive],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form {
            fitted: &[("share_1", 0.2), ("share_2", 0.2), ("share_3", 0.2), ("share_4", 0.2), ("share_5", 0.2)],
            starts: &[
                &[0.2, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.2, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.2, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.2, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.2],
            ],
            given: &[],
        }],
    },
    shape: Some(Shape {
        x: "time constant",
        x_unit: "s",
        y: "weight",
        y_unit: "",
        points: |p| TIMES.into_iter().zip(p).map(|(t, share)| [t, *share]).collect(),
    }),
    action: Action::Voltages(|p, n, _| Box::new(Lags::new(TIMES.into_iter().zip(p.iter().copied()), n))),
};

/// T_j (s).
const TIMES: [f64; 5] = [3e-4, 1e-3, 3e-3, 1e-2, 3e-2];
