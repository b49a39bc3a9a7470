//! The root turns by another curve of the moment on it.
//!
//! ```text
//! φ + T·φ̇ = ∫ C(m) dm from 0 to M_root, C linear between its points, constant beyond
//! ```
//!
//! C is the compliance dφ/dM, so that no weight can make the clamp give way to less moment. Equal weights are the law of `clamp-compliance`; what is in
//! the model beside the curve turns in series with it. A compliance of less than a thousandth of the largest counts as that.
//!
//! # Parameters
//! * `range_mn_m` (mN·m): largest moment of the curve, to either side
//! * `compliance_1_rad_per_n_m` (rad/(N·m)): C at −3/3 of the range
//! * `compliance_2_rad_per_n_m` (rad/(N·m)): C at −2/3 of the range
//! * `compliance_3_rad_per_n_m` (rad/(N·m)): C at −1/3 of the range
//! * `compliance_4_rad_per_n_m` (rad/(N·m)): C at 0
//! * `compliance_5_rad_per_n_m` (rad/(N·m)): C at 1/3 of the range
//! * `compliance_6_rad_per_n_m` (rad/(N·m)): C at 2/3 of the range
//! * `compliance_7_rad_per_n_m` (rad/(N·m)): C at 3/3 of the range
//! * `damping_s` (s): T: damping of the clamp over its stiffness
//!
//! # Source
//! Derived; damping: Kelvin and Voigt’s element.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape, fits};
use crate::model::{CLAMP_POINTS, ClampCurve};

/// See the file's head.
pub const FREE_CLAMP: Effect = Effect {
    id: "free-clamp",
    kind: Kind::Structure,
    cause: "The root turns by another curve of the moment on it.",
    equation: "φ + T·φ̇ = ∫ C(m) dm from 0 to M_root, C linear between its points, constant beyond",
    source: "Derived; damping: Kelvin and Voigt’s element.",
    parameters: &[
        Parameter {
            name: "range_mn_m",
            unit: "mN·m",
            bounds: [1e-6, 1e4],
            off: None,
            default: Some(3.0),
            about: "largest moment of the curve, to either side",
        },
        Parameter {
            name: "compliance_1_rad_per_n_m",
            unit: "rad/(N·m)",
            bounds: [0.0, 10.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "C at −3/3 of the range",
        },
        Parameter {
            name: "compliance_2_rad_per_n_m",
            unit: "rad/(N·m)",
            bounds: [0.0, 10.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "C at −2/3 of the range",
        },
        Parameter {
            name: "compliance_3_rad_per_n_m",
            unit: "rad/(N·m)",
            bounds: [0.0, 10.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "C at −1/3 of the range",
        },
        Parameter {
            name: "compliance_4_rad_per_n_m",
            unit: "rad/(N·m)",
            bounds: [0.0, 10.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "C at 0",
        },
        Parameter {
            name: "compliance_5_rad_per_n_m",
            unit: "rad/(N·m)",
            bounds: [0.0, 10.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "C at 1/3 of the range",
        },
        Parameter {
            name: "compliance_6_rad_per_n_m",
            unit: "rad/(N·m)",
            bounds: [0.0, 10.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "C at 2/3 of the range",
        },
        Parameter {
            name: "compliance_7_rad_per_n_m",
            unit: "rad/(N·m)",
            bounds: [0.0, 10.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "C at 3/3 of the range",
        },
        Parameter {
            name: "damping_s",
            unit: "s",
            bounds: [0.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "T: damping of the clamp over its stiffness",
        },
    ],
    places: &[Place::Clamp],
    fitting: Fitting::Candidate {
        on: fits::clamped,
        variants: &[],
        forms: &[Form {
            fitted: &[
                ("compliance_1_rad_per_n_m", 0.5),
                ("compliance_2_rad_per_n_m", 0.5),
                ("compliance_3_rad_per_n_m", 0.5),
                ("compliance_4_rad_per_n_m", 0.5),
                ("compliance_5_rad_per_n_m", 0.5),
                ("compliance_6_rad_per_n_m", 0.5),
                ("compliance_7_rad_per_n_m", 0.5),
                ("damping_s", 2e-3),
            ],
            // A rigid clamp has no damping to start with: the fit begins at T = 0.
            starts: &[
                &[0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0],
            ],
            given: &[],
        }],
    },
    shape: Some(Shape {
        x: "moment on the root",
        x_unit: "mN·m",
        y: "compliance of the clamp",
        y_unit: "rad/(N·m)",
        points: |p| {
            let third = |k: usize| p[0] * (k as f64 / 3.0 - 1.0);
            p[1..=CLAMP_POINTS].iter().enumerate().map(|(k, compliance)| [third(k), *compliance]).collect()
        },
    }),
    action: Action::Robot(|p, robot| {
        robot.extensions.clamp_curve = ClampCurve::new(1e4 * p[0], std::array::from_fn(|k| 1e-7 * p[k + 1]));
        robot.extensions.clamp_damping += p[8];
    }),
};
