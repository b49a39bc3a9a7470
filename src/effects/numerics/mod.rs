//! The chain and the step in place of a continuum.

mod discretisation;

pub use discretisation::DISCRETISATION;
