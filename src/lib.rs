//! Planar piezoelectric soft robots.

pub mod actuator;
pub mod analytic;
pub mod bullet;
pub mod drive;
pub mod engine;
pub mod model;
