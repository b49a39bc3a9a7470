//! The loss per cycle in the material is nearly independent of frequency, unlike viscous loss.
//!
//! ```text
//! τ = −k·(θ − θ_V + η·θ̇ + ξ·Σ (T_j/T_0)^−α·q_j),  q̇_j = θ̇ − q_j/T_j,  T_j = 10^j s,  loss factor 0.68·ξ at 10 Hz, T_0 = 16 ms;  and −(π/2)·η_A·k·|θ|·tanh(θ̇/ω_ε)
//! ```
//!
//! # Parameters
//! * `loss_factor` (–): loss factor η_h at 10 Hz; the damping ratio is half of it
//! * `exponent` (–): α: the loss factor grows with the frequency to this power
//! * `bending_loss_factor` (–): loss factor η_A of a moment in proportion to the joint's angle, against its motion
//!
//! # Source
//! Derived: a ladder of relaxations with log-uniform times; powers: Bagley and Torvik, J. Rheol. 27 (1983) 201; η_A: Reid, J. R. Aeronaut. Soc. 60 (1956) 283.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};
use crate::model::LOSS_TIMES;

/// See the file's head.
pub const STRUCTURAL_DAMPING: Effect = Effect {
    id: "structural-damping",
    kind: Kind::Structure,
    cause: "The loss per cycle in the material is nearly independent of frequency, unlike viscous loss.",
    equation: "τ = −k·(θ − θ_V + η·θ̇ + ξ·Σ (T_j/T_0)^−α·q_j),  q̇_j = θ̇ − q_j/T_j,  T_j = 10^j s,  loss factor 0.68·ξ at 10 Hz, T_0 = 16 ms;  and −(π/2)·η_A·k·|θ|·tanh(θ̇/ω_ε)",
    source: "Derived: a ladder of relaxations with log-uniform times; powers: Bagley and Torvik, J. Rheol. 27 (1983) 201; η_A: Reid, J. R. Aeronaut. Soc. 60 (1956) 283.",
    parameters: &[
        Parameter {
            name: "loss_factor",
            unit: "",
            bounds: [0.0, 0.2],
            off: Some(0.0),
            default: Some(0.0),
            about: "loss factor η_h at 10 Hz; the damping ratio is half of it",
        },
        Parameter {
            name: "exponent",
            unit: "",
            bounds: [-1.0, 1.0],
            off: None,
            default: Some(0.0),
            about: "α: the loss factor grows with the frequency to this power",
        },
        Parameter {
            name: "bending_loss_factor",
            unit: "",
            bounds: [0.0, 0.2],
            off: Some(0.0),
            default: Some(0.0),
            about: "loss factor η_A of a moment in proportion to the joint's angle, against its motion",
        },
    ],
    places: &[Place::JointMemory, Place::JointMomentOfRate],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[
            Form { fitted: &[("loss_factor", 0.02), ("exponent", 0.2)], starts: &[&[0.02, 0.2], &[0.02, -0.2]], given: &[] },
            Form { fitted: &[("bending_loss_factor", 0.02)], starts: &[&[0.02]], given: &[] },
        ],
        forms: &[Form { fitted: &[("loss_factor", 0.02)], starts: &[&[0.02]], given: &[] }],
    },
    shape: None,
    action: Action::Robot(|p, robot| {
        // 1/(2π·10 Hz).
        const TEN_HERTZ_S: f64 = 0.015_915_494_309_189_534;
        for (share, time) in robot.extensions.loss.iter_mut().zip(LOSS_TIMES) {
            *share += p[0] / 0.68 * (time / TEN_HERTZ_S).powf(-p[1]);
        }
        // The loss of a cycle of amplitude A is 2·c·k·A², and 2π·η_A·k·A²/2.
        robot.extensions.friction_of_bending += std::f64::consts::FRAC_PI_2 * p[2];
    }),
};
