//! The strain follows the voltage with other loops, at any rate.
//!
//! ```text
//! θ_V = −γ·ℓ·g·(V − Σ w_j (V − p_j)),  p_j ← max(V − r_j, min(V + r_j, p_j)),  1/g = 1 − Σ w_j·2r_j/V_s
//! ```
//!
//! # Parameters
//! * `span_v` (V): stroke of the voltage to which the radii refer
//! * `share_1` (–): weight of the play with the radius 0.02 of the stroke
//! * `share_2` (–): weight of the play with the radius 0.05 of the stroke
//! * `share_3` (–): weight of the play with the radius 0.1 of the stroke
//! * `share_4` (–): weight of the play with the radius 0.2 of the stroke
//! * `share_5` (–): weight of the play with the radius 0.3 of the stroke
//! * `share_6` (–): weight of the play with the radius 0.45 of the stroke
//!
//! # Source
//! Prandtl-Ishlinskii: Kuhnen, Eur. J. Control 9 (2003) 407.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape, SignalStage, fits};

/// See the file's head.
pub const FREE_VOLTAGE_PLAYS: Effect = Effect {
    id: "free-voltage-plays",
    kind: Kind::Actuation,
    cause: "The strain follows the voltage with other loops, at any rate.",
    equation: "θ_V = −γ·ℓ·g·(V − Σ w_j (V − p_j)),  p_j ← max(V − r_j, min(V + r_j, p_j)),  1/g = 1 − Σ w_j·2r_j/V_s",
    source: "Prandtl-Ishlinskii: Kuhnen, Eur. J. Control 9 (2003) 407.",
    parameters: &[
        Parameter {
            name: "span_v",
            unit: "V",
            bounds: [1.0, 1e5],
            off: None,
            default: Some(1500.0),
            about: "stroke of the voltage to which the radii refer",
        },
        Parameter {
            name: "share_1",
            unit: "",
            bounds: [0.0, 0.8],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the play with the radius 0.02 of the stroke",
        },
        Parameter {
            name: "share_2",
            unit: "",
            bounds: [0.0, 0.8],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the play with the radius 0.05 of the stroke",
        },
        Parameter {
            name: "share_3",
            unit: "",
            bounds: [0.0, 0.8],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the play with the radius 0.1 of the stroke",
        },
        Parameter {
            name: "share_4",
            unit: "",
            bounds: [0.0, 0.8],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the play with the radius 0.2 of the stroke",
        },
        Parameter {
            name: "share_5",
            unit: "",
            bounds: [0.0, 0.8],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the play with the radius 0.3 of the stroke",
        },
        Parameter {
            name: "share_6",
            unit: "",
            bounds: [0.0, 0.8],
            off: Some(0.0),
            default: Some(0.0),
            about: "weight of the play with the radius 0.45 of the stroke",
        },
    ],
    places: &[Place::VoltageMemory],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[Form {
            fitted: &[
                ("share_1", 0.05),
                ("share_2", 0.05),
                ("share_3", 0.05),
                ("share_4", 0.05),
                ("share_5", 0.05),
                ("share_6", 0.05),
            ],
            starts: &[
                &[0.05, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.05, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.05, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.05, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.05, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.05],
            ],
            given: &[],
        }],
    },
    shape: Some(Shape {
        x: "radius",
        x_unit: "V",
        y: "weight",
        y_unit: "",
        points: |p| RADII.into_iter().zip(&p[1..]).map(|(r, share)| [r * p[0], *share]).collect(),
    }),
    action: Action::Voltages(|p, n, _| Box::new(Plays::new(p, n))),
};

/// Radii as shares of the stroke.
const RADII: [f64; 6] = [0.02, 0.05, 0.1, 0.2, 0.3, 0.45];

struct Plays {
    /// Radii (V) and weights.
    elements: Vec<[f64; 2]>,
    gain: f64,
    /// p_j (V), actuators × elements.
    state: Vec<f64>,
}

impl Plays {
    fn new(p: &[f64], actuators: usize) -> Self {
        let elements: Vec<[f64; 2]> = RADII.into_iter().zip(&p[1..]).map(|(r, share)| [r * p[0], *share]).collect();
        let loss: f64 = RADII.into_iter().zip(&p[1..]).map(|(r, share)| 2.0 * r * share).sum();
        Self { state: vec![0.0; actuators * elements.len()], elements, gain: 1.0 / (1.0 - loss).max(0.1) }
    }
}

impl SignalStage for Plays {
    fn settle(&mut self, volts: &mut [f64]) {
        for (state, v) in self.state.chunks_exact_mut(self.elements.len()).zip(volts) {
            state.fill(*v);
            *v *= self.gain;
        }
    }

    fn pass(&mut self, _dt: f64, volts: &mut [f64]) {
        for (state, v) in self.state.chunks_exact_mut(self.elements.len()).zip(volts) {
            let mut lost = 0.0;
            for (p, [radius, share]) in state.iter_mut().zip(&self.elements) {
                *p = p.clamp(*v - radius, *v + radius);
                lost += share * (*v - *p);
            }
            *v = self.gain * (*v - lost);
        }
    }

    fn memory(&self) -> Vec<f64> {
        self.state.clone()
    }

    fn remember(&mut self, memory: &[f64]) {
        self.state.copy_from_slice(memory);
    }
}
