//! Between voltage and strain.

mod creep;
mod field_dependent_gain;
mod free_gain_along;
mod free_voltage_curve;
mod free_voltage_memory;
mod free_voltage_plays;
mod gain_drift;
mod hysteresis;
mod passive_margin;
mod polarity_asymmetry;
mod remanence;
mod wake_up;
mod weak_actuator;

pub use creep::CREEP;
pub use field_dependent_gain::FIELD_DEPENDENT_GAIN;
pub use free_gain_along::FREE_GAIN_ALONG;
pub use free_voltage_curve::FREE_VOLTAGE_CURVE;
pub use free_voltage_memory::FREE_VOLTAGE_MEMORY;
pub use free_voltage_plays::FREE_VOLTAGE_PLAYS;
pub use gain_drift::GAIN_DRIFT;
pub use hysteresis::HYSTERESIS;
pub(crate) use hysteresis::secants;
pub use passive_margin::PASSIVE_MARGIN;
pub use polarity_asymmetry::POLARITY_ASYMMETRY;
pub use remanence::REMANENCE;
pub use wake_up::WAKE_UP;
pub use weak_actuator::WEAK_ACTUATOR;
