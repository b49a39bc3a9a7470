//! From measured data to what the simulation gets wrong, why, and by how much less it is wrong with the cause in the model.
//!
//! The way: [`dataset`] reads runs, [`quality`] looks for noise, outliers and frozen markers, [`voltage`] reads commands between rows. [`plant`] is all
//! that the loop knows of the thing that was measured; [`robot`] makes our robots one. [`fit`] does least squares, [`search`] screens candidates,
//! adds and takes out causes and judges them on runs that no fit saw, and [`pipeline`] puts it together: numerics before constants, constants and
//! measurement errors before physics, ties named as ties, and what is left described ([`tests`]) in a [`diagnosis`]. [`protocols`] proposes what to measure next;
//! [`report`] and [`extended`] write it down, in the words of [`names`]; [`observations`] does what can be done with single published numbers.

pub mod dataset;
pub mod diagnosis;
pub mod extended;
pub mod fit;
mod intervals;
pub mod names;
pub mod observations;
#[cfg(feature = "view")]
mod picture;
pub mod pipeline;
pub mod plant;
pub mod protocols;
pub mod quality;
#[cfg(feature = "view")]
pub mod report;
pub mod residual_tests;
pub mod robot;
pub mod search;
pub mod voltage;
