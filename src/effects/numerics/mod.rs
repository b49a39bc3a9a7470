//! Discretisation in space and time.

mod discretisation;

pub use discretisation::DISCRETISATION;
