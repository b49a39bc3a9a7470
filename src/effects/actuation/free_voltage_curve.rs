//! The actuators follow another curve of the voltage.
//!
//! ```text
//! θ_V = −γ·ℓ·(V + c(V))
//! ```
//!
//! # Parameters
//! * `low_v` (V): lowest voltage of the curve
//! * `high_v` (V): highest voltage of the curve
//! * `below_1_v` (V): c at 1/8 of the range below 0
//! * `below_2_v` (V): c at 2/8 of the range below 0
//! * `below_3_v` (V): c at 3/8 of the range below 0
//! * `below_4_v` (V): c at 4/8 of the range below 0
//! * `below_5_v` (V): c at 5/8 of the range below 0
//! * `below_6_v` (V): c at 6/8 of the range below 0
//! * `below_7_v` (V): c at 7/8 of the range below 0
//! * `below_8_v` (V): c at 8/8 of the range below 0
//! * `above_1_v` (V): c at 1/8 of the range above 0
//! * `above_2_v` (V): c at 2/8 of the range above 0
//! * `above_3_v` (V): c at 3/8 of the range above 0
//! * `above_4_v` (V): c at 4/8 of the range above 0
//! * `above_5_v` (V): c at 5/8 of the range above 0
//! * `above_6_v` (V): c at 6/8 of the range above 0
//! * `above_7_v` (V): c at 7/8 of the range above 0
//! * `above_8_v` (V): c at 8/8 of the range above 0
//!
//! # Source
//! Restoring-force surface: Masri and Caughey, J. Appl. Mech. 46 (1979) 433; cubic through points: Catmull and Rom 1974.

use crate::effects::{
    Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape, SignalStage,
    curve::{points, two_sided},
    fits,
};
use crate::model::Curve;

/// See the file's head.
pub const FREE_VOLTAGE_CURVE: Effect = Effect {
    id: "free-voltage-curve",
    kind: Kind::Actuation,
    cause: "The actuators follow another curve of the voltage.",
    equation: "θ_V = −γ·ℓ·(V + c(V))",
    source: "Restoring-force surface: Masri and Caughey, J. Appl. Mech. 46 (1979) 433; cubic through points: Catmull and Rom 1974.",
    parameters: &[
        Parameter {
            name: "low_v",
            unit: "V",
            bounds: [-1e5, 0.0],
            off: None,
            default: Some(-1500.0),
            about: "lowest voltage of the curve",
        },
        Parameter {
            name: "high_v",
            unit: "V",
            bounds: [0.0, 1e5],
            off: None,
            default: Some(1500.0),
            about: "highest voltage of the curve",
        },
        Parameter {
            name: "below_1_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 1/8 of the range below 0",
        },
        Parameter {
            name: "below_2_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 2/8 of the range below 0",
        },
        Parameter {
            name: "below_3_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 3/8 of the range below 0",
        },
        Parameter {
            name: "below_4_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 4/8 of the range below 0",
        },
        Parameter {
            name: "below_5_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 5/8 of the range below 0",
        },
        Parameter {
            name: "below_6_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 6/8 of the range below 0",
        },
        Parameter {
            name: "below_7_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 7/8 of the range below 0",
        },
        Parameter {
            name: "below_8_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 8/8 of the range below 0",
        },
        Parameter {
            name: "above_1_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 1/8 of the range above 0",
        },
        Parameter {
            name: "above_2_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 2/8 of the range above 0",
        },
        Parameter {
            name: "above_3_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 3/8 of the range above 0",
        },
        Parameter {
            name: "above_4_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 4/8 of the range above 0",
        },
        Parameter {
            name: "above_5_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 5/8 of the range above 0",
        },
        Parameter {
            name: "above_6_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 6/8 of the range above 0",
        },
        Parameter {
            name: "above_7_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 7/8 of the range above 0",
        },
        Parameter {
            name: "above_8_v",
            unit: "V",
            bounds: [-3000.0, 3000.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "c at 8/8 of the range above 0",
        },
    ],
    places: &[Place::VoltageCurve],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[],
        forms: &[Form {
            fitted: &[
                ("below_1_v", 50.0),
                ("below_2_v", 50.0),
                ("below_3_v", 50.0),
                ("below_4_v", 50.0),
                ("below_5_v", 50.0),
                ("below_6_v", 50.0),
                ("below_7_v", 50.0),
                ("below_8_v", 50.0),
                ("above_1_v", 50.0),
                ("above_2_v", 50.0),
                ("above_3_v", 50.0),
                ("above_4_v", 50.0),
                ("above_5_v", 50.0),
                ("above_6_v", 50.0),
                ("above_7_v", 50.0),
                ("above_8_v", 50.0),
            ],
            starts: &[
                &[50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 50.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 50.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 50.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 50.0],
            ],
            given: &[],
        }],
    },
    shape: Some(Shape {
        x: "voltage",
        x_unit: "V",
        y: "additional effective voltage",
        y_unit: "V",
        points: |p| points(&curve(p)),
    }),
    action: Action::Voltages(|p, _, _| Box::new(Bent(curve(p)))),
};

/// Points on each side: close enough to show a limit's corner or a dead zone.
const POINTS: usize = 8;

fn curve(p: &[f64]) -> Curve<POINTS> {
    two_sided([-p[0], p[1]], &p[2..], 1.0)
}

struct Bent(Curve<POINTS>);

impl SignalStage for Bent {
    fn settle(&mut self, volts: &mut [f64]) {
        volts.iter_mut().for_each(|v| *v += self.0.at(*v)[0]);
    }

    fn pass(&mut self, _dt: f64, volts: &mut [f64]) {
        self.settle(volts);
    }
}
