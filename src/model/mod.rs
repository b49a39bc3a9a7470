//! The physical model: layers become a beam, the beam becomes a chain of motor-link units.
//!
//! Frame, used everywhere: the chain lies along +x from its left end, z points up, joints turn about +y. A positive joint angle
//! lowers the far end (a right-handed turn about +y takes +x towards −z); a negative voltage gives a positive rest angle, so it
//! bends the free end of a clamped robot down.
//!
//! Two sets of constants were published, and neither matches both published measurements:
//!
//! | | [`Material::PARAMETER_2`] | [`Material::PARAMETER_4`] | published |
//! | --- | --- | --- | --- |
//! | first frequency of the cantilever (Euler-Bernoulli) | 18.1 Hz | 24.0 Hz | 23 Hz measured, 25 Hz simulated |
//! | static tip at −1000 V, m = 3 | −19.0 mm | −23.4 mm | −20 mm |

mod builder;
mod clamp;
mod curve;
mod extensions;
mod friction;
mod laminate;
mod robot;
pub mod units;

pub use clamp::{CLAMP_POINTS, ClampCurve};
pub use curve::{CURVE_POINTS, Curve};
pub(crate) use extensions::LEAST_DRAG_RATIO;
pub use extensions::{
    AIR_DENSITY, ATTACHMENT_RATE, Attachment, DRAG_POWERS, DRAG_SPEED, DRY_FRICTION_RATE, Extensions, LEAST_STIFFNESS,
    LOSS_TIMES, PointMass, SOFTENING_CURVATURE, Slip, StickSlip, VISCOUS_REACH,
};
pub use friction::{FRICTION_POINTS, FrictionCurve};
pub use laminate::{Laminate, Material};
pub use robot::{Damping, Film, Friction, MAX_JOINTS, Mount, RigidBody, Robot, Segment, box_inertia};

use thiserror::Error;

use crate::words::number;

/// A robot that cannot be built.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A constant out of range.
    #[error("{key} is {}, but must be {needed}", number(*.value))]
    Value {
        /// Key of the experiment file.
        key: &'static str,
        /// Its value, in the key's unit.
        value: f64,
        /// The range that is accepted.
        needed: &'static str,
    },
}

/// Largest size of a constant in CGS units, and the reciprocal of the least: what is computed of such constants neither overflows nor vanishes.
const LARGEST: f64 = 1e20;

impl ModelError {
    /// `value` is in CGS units.
    pub(crate) fn unless(holds: bool, key: &'static str, value: f64, needed: &'static str) -> Result<(), Self> {
        // Infinity stands for "no limit" where it is allowed.
        let computable = value == 0.0 || value.is_infinite() || (1.0 / LARGEST..=LARGEST).contains(&value.abs());
        let needed = if holds && !computable { "of a size between 1e-20 and 1e20 in CGS units" } else { needed };
        if holds && computable { Ok(()) } else { Err(Self::Value { key, value: units::in_unit_of(key, value), needed }) }
    }
}
