//! Diagnosis of model error from measured data: detect, locate, characterise and estimate what the simulation lacks.
//!
//! [`dataset`] reads runs, [`quality`] estimates noise and masks outliers and frozen markers, [`voltage`] interpolates commands between rows. A
//! [`plant`] is the measured system with its model; [`robot`] is the plant of this crate's robots. [`fit`] is bounded least squares; [`search`] selects
//! causes on runs that no fit saw, by their [`split`]; [`pipeline`] combines them: discretisation before constants, constants and measurement errors before physics, and
//! [residual tests](residual_tests) of the final model, in a [`diagnosis`]. [`protocols`] proposes the next measurement; [`report`] and [`extended`]
//! write the results, with the [`names`] of causes; [`observations`] diagnoses single published numbers, [`identify`] fits constants to many of them; [`answer`] does what the data set asks, whatever its data are.
//!
//! # References
//! G. Kerschen, K. Worden, A. F. Vakakis and J.-C. Golinval, "Past, present and future of nonlinear system identification in structural dynamics",
//! Mech. Syst. Signal Process. 20 (2006) 505; J. Brynjarsdóttir and A. O'Hagan, "Learning about physical parameters: the importance of model
//! discrepancy", Inverse Problems 30 (2014) 114007.

mod adopted;
#[cfg(feature = "view")]
pub mod answer;
pub mod bench;
mod blocks;
mod budget;
mod candidates;
mod causes;
pub mod combinations;
mod conventions;
mod curve;
pub mod dataset;
pub mod diagnosis;
mod error;
pub mod extended;
mod faults;
pub mod fit;
mod forward;
pub mod identify;
mod intervals;
mod kept;
pub mod names;
mod naming;
pub mod noise;
pub mod observations;
#[cfg(feature = "view")]
mod picture;
pub mod pipeline;
pub mod plant;
mod prediction;
mod projection;
pub mod protocols;
pub mod quality;
#[cfg(test)]
#[path = "../../tests/common/random.rs"]
mod random;
#[cfg(feature = "view")]
pub mod report;
pub mod residual_tests;
mod response;
pub mod robot;
mod run_csv;
pub mod search;
mod smoothing;
pub mod split;
mod stability;
mod subset;
mod summary;
mod ties;
mod track;
mod unseen;
mod verdict;
mod visited;
pub mod voltage;
#[cfg(test)]
mod waves;

pub use error::DiagnoseError;
