//! The signal chain from commanded to effective voltages.

use super::{Action, Applied, EFFECTS};

/// A stage of the signal chain: a filter of the voltages of all actuators, which may have a state.
pub trait SignalStage: Send {
    /// Sets the state of rest at constant input voltages `volts` (V, one per actuator), and replaces them by the output.
    fn settle(&mut self, volts: &mut [f64]);

    /// Advances the state by a step of `dt` (s), and replaces the step's mean input voltages `volts` (V) by the mean output.
    fn pass(&mut self, dt: f64, volts: &mut [f64]);

    /// Number of parts into which a step is divided if the voltage may jump within it.
    fn parts(&self) -> usize {
        1
    }

    /// Number of parts, at most [`parts`](Self::parts), that a step of `dt` (s) needs in which the commanded voltages (V, one per actuator) go `from` some
    /// `to` others.
    fn parts_between(&self, _dt: f64, _from: &[f64], _to: &[f64]) -> usize {
        self.parts()
    }

    /// The state as numbers, for checkpoints.
    fn memory(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Length of this stage's state at the beginning of `saved`; none if `saved` does not begin with one.
    fn held(&self, saved: &[f64]) -> Option<usize> {
        Some(self.memory().len()).filter(|len| *len <= saved.len())
    }

    /// Restores a state of the length that [`held`](Self::held) returned.
    fn remember(&mut self, _memory: &[f64]) {}
}

/// The stages of a run, in the order of [`EFFECTS`].
pub struct SignalChain {
    stages: Vec<Box<dyn SignalStage>>,
}

impl SignalChain {
    /// The chain of `effects` for a number of `actuators` and a run of `duration` (s).
    pub fn new(effects: &[Applied], actuators: usize, duration: f64) -> Self {
        let of =
            |id: &str| effects.iter().filter(move |applied| applied.effect.id == id && !applied.is_off()).collect::<Vec<_>>();
        let stages = EFFECTS.iter().flat_map(|effect| of(effect.id)).filter_map(|applied| match applied.effect.action {
            Action::Voltages(make) => Some(make(&applied.values, actuators, duration)),
            _ => None,
        });
        Self { stages: stages.collect() }
    }

    /// True without stages.
    pub fn is_empty(&self) -> bool {
        self.stages.is_empty()
    }

    /// Sets the state of rest at constant input voltages `volts` (V, one per actuator), and replaces them by the output.
    pub fn settle(&mut self, volts: &mut [f64]) {
        self.stages.iter_mut().for_each(|stage| stage.settle(volts));
    }

    /// Advances all stages by a step of `dt` (s), and replaces the step's mean input voltages `volts` (V) by the mean output.
    pub fn pass(&mut self, dt: f64, volts: &mut [f64]) {
        self.stages.iter_mut().for_each(|stage| stage.pass(dt, volts));
    }

    /// Number of parts into which a step is divided if the voltage may jump within it.
    pub fn parts(&self) -> usize {
        self.stages.iter().map(|stage| stage.parts()).max().unwrap_or(1)
    }

    /// Number of parts that a step of `dt` (s) needs, by the voltages that are `commanded` at its beginning, at its end and at the end of the next one (V, one per
    /// actuator): a jump at the beginning of the next step starts a ramp from the middle of the part before.
    pub fn parts_of_step(&self, dt: f64, commanded: &[Vec<f64>; 3]) -> usize {
        let of = |ends: &[Vec<f64>]| self.stages.iter().map(|stage| stage.parts_between(dt, &ends[0], &ends[1])).max();
        commanded.windows(2).filter_map(of).max().unwrap_or(1)
    }

    /// The state of all stages as numbers, for checkpoints.
    pub fn save(&self) -> Vec<f64> {
        self.stages.iter().flat_map(|stage| stage.memory()).collect()
    }

    /// Length of the chain's state at the beginning of `saved`; none if `saved` does not begin with one.
    pub fn held(&self, saved: &[f64]) -> Option<usize> {
        self.stages.iter().try_fold(0, |held, stage| Some(held + stage.held(&saved[held..])?))
    }

    /// Restores a state from [`save`](Self::save).
    pub fn load(&mut self, mut saved: &[f64]) {
        for stage in &mut self.stages {
            let Some((own, rest)) = stage.held(saved).and_then(|held| saved.split_at_checked(held)) else { return };
            stage.remember(own);
            saved = rest;
        }
    }
}
