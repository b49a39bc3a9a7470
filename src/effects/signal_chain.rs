//! The way of the voltages from command to actuator.

use super::{Action, Applied, EFFECTS};

/// Passes on the voltages of all actuators, step by step, with whatever memory that takes.
pub trait SignalStage: Send {
    /// Comes to rest at constant `volts` (V), one per actuator, and turns them into what comes out.
    fn settle(&mut self, volts: &mut [f64]);

    /// Turns the mean voltages of a step of `dt` (s) into what comes out.
    fn pass(&mut self, dt: f64, volts: &mut [f64]);

    /// Into how many parts a step is better cut where the voltage may jump within it.
    fn parts(&self) -> usize {
        1
    }

    /// Its memory, as numbers for storing.
    fn memory(&self) -> Vec<f64> {
        Vec::new()
    }

    /// How many numbers at the beginning of `saved` are a memory of its; none if they cannot be.
    fn held(&self, saved: &[f64]) -> Option<usize> {
        Some(self.memory().len()).filter(|len| *len <= saved.len())
    }

    /// Takes up a memory that [`held`](Self::held) has found.
    fn remember(&mut self, _memory: &[f64]) {}
}

/// All voltage effects of a run, in the order in which they act.
pub struct SignalChain {
    stages: Vec<Box<dyn SignalStage>>,
}

impl SignalChain {
    /// The way through `effects` for a robot of `actuators` actuators in a run of `duration` (s).
    pub fn new(effects: &[Applied], actuators: usize, duration: f64) -> Self {
        let of =
            |id: &str| effects.iter().filter(move |applied| applied.effect.id == id && !applied.is_off()).collect::<Vec<_>>();
        let stages = EFFECTS.iter().flat_map(|effect| of(effect.id)).filter_map(|applied| match applied.effect.action {
            Action::Voltages(make) => Some(make(&applied.values, actuators, duration)),
            _ => None,
        });
        Self { stages: stages.collect() }
    }

    /// Whether nothing stands in the way.
    pub fn is_empty(&self) -> bool {
        self.stages.is_empty()
    }

    /// Comes to rest at `volts`, which become what comes out.
    pub fn settle(&mut self, volts: &mut [f64]) {
        self.stages.iter_mut().for_each(|stage| stage.settle(volts));
    }

    /// Passes on a step's mean voltages.
    pub fn pass(&mut self, dt: f64, volts: &mut [f64]) {
        self.stages.iter_mut().for_each(|stage| stage.pass(dt, volts));
    }

    /// Into how many parts steps are better cut.
    pub fn parts(&self) -> usize {
        self.stages.iter().map(|stage| stage.parts()).max().unwrap_or(1)
    }

    /// All memory, as numbers for storing.
    pub fn save(&self) -> Vec<f64> {
        self.stages.iter().flat_map(|stage| stage.memory()).collect()
    }

    /// How many numbers at the beginning of `saved` are a memory of this path; none if they cannot be.
    pub fn held(&self, saved: &[f64]) -> Option<usize> {
        self.stages.iter().try_fold(0, |held, stage| Some(held + stage.held(&saved[held..])?))
    }

    /// Takes those numbers up again.
    pub fn load(&mut self, mut saved: &[f64]) {
        for stage in &mut self.stages {
            let Some((own, rest)) = stage.held(saved).and_then(|held| saved.split_at_checked(held)) else { return };
            stage.remember(own);
            saved = rest;
        }
    }
}
