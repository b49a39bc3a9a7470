//! The amplifier or a protection limits the level of the voltage.
//!
//! ```text
//! V_a = min(V_hi, max(V_lo, V_c))
//! ```
//!
//! # Parameters
//! * `max_v` (V): largest voltage V_hi
//! * `min_v` (V): least voltage V_lo
//!
//! # Source
//! Limits of the MFC actuator: data sheet, Smart Material Corp.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, SignalStage, fits};

/// See the file's head.
pub const SATURATION: Effect = Effect {
    id: "saturation",
    kind: Kind::Driver,
    cause: "The amplifier or a protection limits the level of the voltage.",
    equation: "V_a = min(V_hi, max(V_lo, V_c))",
    source: "Limits of the MFC actuator: data sheet, Smart Material Corp.",
    parameters: &[
        Parameter {
            name: "max_v",
            unit: "V",
            bounds: [0.0, 5000.0],
            off: Some(f64::INFINITY),
            default: Some(f64::INFINITY),
            about: "largest voltage V_hi",
        },
        Parameter {
            name: "min_v",
            unit: "V",
            bounds: [-5000.0, 0.0],
            off: Some(f64::NEG_INFINITY),
            default: Some(f64::NEG_INFINITY),
            about: "least voltage V_lo",
        },
    ],
    places: &[Place::VoltageCurve, Place::Drive],
    fitting: Fitting::Candidate {
        on: fits::any,
        forms: &[
            Form { fitted: &[("min_v", 0.0002)], starts: &[&[-1.0 / 1300.0], &[-1.0 / 1000.0], &[-1.0 / 700.0]], given: &[] },
            Form {
                fitted: &[("max_v", 0.0002)],
                starts: &[&[1.0 / 1300.0], &[1.0 / 800.0], &[1.0 / 400.0], &[1.0 / 200.0]],
                given: &[],
            },
        ],
    },
    shape: None,
    action: Action::Voltages(|p, _, _| Box::new(Limits { max: p[0], min: p[1] })),
};

struct Limits {
    max: f64,
    min: f64,
}

impl SignalStage for Limits {
    fn settle(&mut self, volts: &mut [f64]) {
        volts.iter_mut().for_each(|v| *v = v.max(self.min).min(self.max));
    }

    fn pass(&mut self, _dt: f64, volts: &mut [f64]) {
        self.settle(volts);
    }
}
