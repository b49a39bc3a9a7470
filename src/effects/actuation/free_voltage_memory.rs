//! The strain follows the voltage with other delays.
//!
//! ```text
//! θ_V = −γ·ℓ·(V + Σ w_j (q_j − V)),  q̇_j = (V − q_j)/T_j
//! ```
//!
//! # Parameters
//! * `share_1` (–): weight of the element with T = 0.01 s
//! * `share_2` (–): weight of the element with T = 0.03 s
//! * `share_3` (–): weight of the element with T = 0.1 s
//! * `share_4` (–): weight of the element with T = 0.3 s
//! * `share_5` (–): weight of the element with T = 1 s
//! * `share_6` (–): weight of the element with T = 3 s
//! * `share_7` (–): weight of the element with T = 10 s
//!
//! # Source
//! Kelvin-Voigt chain: Tschoegl, The Phenomenological Theory of Linear Viscoelastic Behavior, 1989.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape, driver::Lags, fits};

/// See the file's head.
pub const FREE_VOLTAGE_MEMORY: Effect = Effect {
    id: "free-voltage-memory",
    kind: Kind::Actuation,
    cause: "The strain follows the voltage with other delays.",
    equation: "θ_V = −γ·ℓ·(V + Σ w_j (q_j − V)),  q̇_j = (V − q_j)/T_j",
    source: "Kelvin-Voigt chain: Tschoegl, The Phenomenological Theory of Linear Viscoelastic Behavior, 1989.",
    parameters: &[
        Parameter {
            name: "share_1",
            unit: "",
            bounds: [0.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the element with T = 0.01 s",
        },
        Parameter {
            name: "share_2",
            unit: "",
            bounds: [0.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the element with T = 0.03 s",
        },
        Parameter {
            name: "share_3",
            unit: "",
            bounds: [0.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the element with T = 0.1 s",
        },
        Parameter {
            name: "share_4",
            unit: "",
            bounds: [0.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the element with T = 0.3 s",
        },
        Parameter {
            name: "share_5",
            unit: "",
            bounds: [0.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the element with T = 1 s",
        },
        Parameter {
            name: "share_6",
            unit: "",
            bounds: [0.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the element with T = 3 s",
        },
        Parameter {
            name: "share_7",
            unit: "",
            bounds: [0.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the element with T = 10 s",
        },
    ],
    places: &[Place::VoltageMemory],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form {
            fitted: &[
                ("share_1", 0.02),
                ("share_2", 0.02),
                ("share_3", 0.02),
                ("share_4", 0.02),
                ("share_5", 0.02),
                ("share_6", 0.02),
                ("share_7", 0.02),
            ],
            starts: &[
                &[0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.02, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02],
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
const TIMES: [f64; 7] = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0];
