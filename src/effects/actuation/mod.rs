//! Between voltage and strain.

mod creep;
mod field_dependent_gain;
mod hysteresis;
mod passive_margin;
mod polarity_asymmetry;
mod weak_actuator;

pub use creep::CREEP;
pub use field_dependent_gain::FIELD_DEPENDENT_GAIN;
pub use hysteresis::HYSTERESIS;
pub use passive_margin::PASSIVE_MARGIN;
pub use polarity_asymmetry::POLARITY_ASYMMETRY;
pub use weak_actuator::WEAK_ACTUATOR;
