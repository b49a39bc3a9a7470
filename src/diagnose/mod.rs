//! From measured data to what the simulation gets wrong, why, and by how much less it is wrong with the cause in the model.

pub mod dataset;
pub mod extended;
pub mod fit;
pub mod observations;
pub mod plant;
pub mod protocols;
pub mod quality;
pub mod report;
pub mod robot;
pub mod search;
pub mod tests;
pub mod verdict;
pub mod voltage;
