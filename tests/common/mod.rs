//! What several test files use.

#![allow(dead_code)] // every user takes a part of it

pub mod pages;

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

/// Numbers from 0 to 1 (splitmix64).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn share(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn below(&mut self, count: usize) -> usize {
        (count as f64 * self.share()) as usize
    }

    /// Evenly on a logarithmic scale.
    pub fn scale(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.share())
    }
}
