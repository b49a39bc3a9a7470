//! The curvature per volt differs from nominal: charge constant, thickness, bond layer or driver gain.
//!
//! ```text
//! θ_V = −s·γ·ℓ·V
//! ```
//!
//! # Parameters
//! * `scale` (–): factor s on the curvature per volt
//!
//! # Source
//! Free strain: Williams, thesis, 2004; shear lag in the bond: Crawley and de Luis 1987.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, fits};

/// See the file's head.
pub const ACTUATION_GAIN: Effect = Effect {
    id: "actuation-gain",
    kind: Kind::Calibration,
    cause: "The curvature per volt differs from nominal: charge constant, thickness, bond layer or driver gain.",
    equation: "θ_V = −s·γ·ℓ·V",
    source: "Free strain: Williams, thesis, 2004; shear lag in the bond: Crawley and de Luis 1987.",
    parameters: &[Parameter::scale([0.4, 2.0], "factor s on the curvature per volt")],
    places: &[Place::VoltageCurve],
    fitting: Fitting::Candidate { on: fits::any, forms: &[Form { fitted: &[("scale", 0.1)], starts: &[&[1.05]], given: &[] }] },
    shape: None,
    action: Action::Robot(|p, robot| robot.extensions.gain_scale *= p[0]),
};
