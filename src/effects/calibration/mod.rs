//! Constants of the nominal model, changed by a factor.

mod actuation_gain;
mod areal_mass;
mod damping;
mod stiffness;

pub use actuation_gain::ACTUATION_GAIN;
pub use areal_mass::AREAL_MASS;
pub use damping::DAMPING;
pub use stiffness::STIFFNESS;
