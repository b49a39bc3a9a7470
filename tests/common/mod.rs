//! What several test files use.

#![allow(dead_code)] // every user takes a part of it

pub mod long;
pub mod pages;
pub mod random;
pub mod tools;

use std::path::Path;
use std::process::{Command, Output, Stdio};

use sfers::engine::Engine;
use sfers::experiment::Experiment;

/// Runs the command in a folder to its end.
pub fn sfers(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sfers")).args(arguments).current_dir(folder).stdin(Stdio::null()).output().unwrap()
}

/// Steps an engine from `from` to `to`, with the loop of `experiment::run`, and gives the bits of what the joints did.
pub fn advance(experiment: &Experiment, engine: &mut dyn Engine, from: u64, to: u64) -> Vec<u64> {
    let mut voltages = vec![0.0; experiment.robot.actuators];
    let mut bits = Vec::new();
    for step in from..to {
        experiment.drive.voltages(step.saturating_sub(1) as f64 * experiment.time_step, &mut voltages);
        engine.prepare(&voltages).unwrap();
        let joints = engine.joints();
        bits.extend(joints.angles.iter().chain(&joints.rates).chain(&joints.torques).map(|value| value.to_bits()));
        engine.advance().unwrap();
    }
    bits
}
