//! The picture is shifted, stretched, sheared, turned or bent.
//!
//! ```text
//! x_m = x + a₀ + a₁·x + a₂·z + (a₃·x² + a₄·x·z + a₅·z²)/R, z_m likewise with b
//! ```
//!
//! It acts after the other effects on the picture. The weights of an axis without a measured channel are not fitted. A delay is none of its laws. The curve of a
//! report is one section of the map: z_m − z along z, at x = 0.
//!
//! # Parameters
//! * `range_mm` (mm): R: coordinate at which a second-order weight is a share of the coordinate
//! * `x_offset_mm` (mm): a₀: added to x
//! * `x_of_x` (–): a₁: added to x per x
//! * `x_of_z` (–): a₂: added to x per z
//! * `x_of_xx` (–): a₃: added to x per x²/R
//! * `x_of_xz` (–): a₄: added to x per x·z/R
//! * `x_of_zz` (–): a₅: added to x per z²/R
//! * `z_offset_mm` (mm): b₀: added to z
//! * `z_of_x` (–): b₁: added to z per x
//! * `z_of_z` (–): b₂: added to z per z
//! * `z_of_xx` (–): b₃: added to z per x²/R
//! * `z_of_xz` (–): b₄: added to z per x·z/R
//! * `z_of_zz` (–): b₅: added to z per z²/R
//!
//! # Source
//! Derived: the polynomial of second order in both coordinates; radial distortion, of third order, is none of it.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, Shape, fits};

/// See the file's head.
pub const FREE_PICTURE: Effect = Effect {
    id: "free-picture",
    kind: Kind::Measurement,
    cause: "The picture is shifted, stretched, sheared, turned or bent.",
    equation: "x_m = x + a₀ + a₁·x + a₂·z + (a₃·x² + a₄·x·z + a₅·z²)/R, z_m likewise with b",
    source: "Derived: the polynomial of second order in both coordinates; radial distortion, of third order, is none of it.",
    parameters: &[
        Parameter {
            name: "range_mm",
            unit: "mm",
            bounds: [1e-3, 1e6],
            off: None,
            default: Some(100.0),
            about: "R: coordinate at which a second-order weight is a share of the coordinate",
        },
        Parameter {
            name: "x_offset_mm",
            unit: "mm",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "a₀: added to x",
        },
        Parameter {
            name: "x_of_x",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "a₁: added to x per x",
        },
        Parameter {
            name: "x_of_z",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "a₂: added to x per z",
        },
        Parameter {
            name: "x_of_xx",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "a₃: added to x per x²/R",
        },
        Parameter {
            name: "x_of_xz",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "a₄: added to x per x·z/R",
        },
        Parameter {
            name: "x_of_zz",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "a₅: added to x per z²/R",
        },
        Parameter {
            name: "z_offset_mm",
            unit: "mm",
            bounds: [-100.0, 100.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "b₀: added to z",
        },
        Parameter {
            name: "z_of_x",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "b₁: added to z per x",
        },
        Parameter {
            name: "z_of_z",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "b₂: added to z per z",
        },
        Parameter {
            name: "z_of_xx",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "b₃: added to z per x²/R",
        },
        Parameter {
            name: "z_of_xz",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "b₄: added to z per x·z/R",
        },
        Parameter {
            name: "z_of_zz",
            unit: "",
            bounds: [-1.0, 1.0],
            off: Some(0.0),
            default: Some(0.0),
            about: "b₅: added to z per z²/R",
        },
    ],
    places: &[Place::Picture],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[],
        forms: &[Form {
            fitted: &[
                ("x_offset_mm", 0.2),
                ("x_of_x", 0.02),
                ("x_of_z", 0.02),
                ("x_of_xx", 0.02),
                ("x_of_xz", 0.02),
                ("x_of_zz", 0.02),
                ("z_offset_mm", 0.2),
                ("z_of_x", 0.02),
                ("z_of_z", 0.02),
                ("z_of_xx", 0.02),
                ("z_of_xz", 0.02),
                ("z_of_zz", 0.02),
            ],
            starts: &[
                &[0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02, 0.0],
                &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02],
            ],
            given: &[],
        }],
    },
    shape: Some(Shape {
        x: "z",
        x_unit: "mm",
        y: "z recorded less z, at x = 0",
        y_unit: "mm",
        points: |p| {
            let [range, weights @ ..] = p else { return Vec::new() };
            let at = |k: i32| range * 0.1 * f64::from(k);
            (-10..=10).map(at).map(|z| [z, weights[6] + z * (weights[8] + weights[11] * z / range)]).collect()
        },
    }),
    action: Action::View(|p, view| {
        let range = 0.1 * p[0];
        // Offsets from mm to cm; second order per cm.
        let units = [0.1, 1.0, 1.0, 1.0 / range, 1.0 / range, 1.0 / range];
        for (own, weights) in view.distortion.iter_mut().zip(p[1..].chunks_exact(units.len())) {
            own.iter_mut().zip(weights).zip(units).for_each(|((own, weight), unit)| *own += unit * weight);
        }
    }),
};
