//! From measured data to what the simulation gets wrong, why, and by how much less it is wrong with the cause in the model.

pub mod dataset;
pub mod fit;
pub mod plant;
pub mod quality;
pub mod robot;
pub mod search;
pub mod tests;
pub mod verdict;
pub mod voltage;
