//! Planar piezoelectric soft robots.

pub mod actuator;
pub mod analytic;
pub mod bullet;
pub mod cli;
pub mod crosscheck;
pub mod drive;
pub mod engine;
pub mod experiment;
pub mod model;
pub mod recording;
