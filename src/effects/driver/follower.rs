//! Drivers whose state is the applied voltage of each actuator.

use crate::effects::SignalStage;

/// How the applied voltages follow the commanded ones.
pub(super) trait Law: Send {
    /// See [`SignalStage::parts`].
    const PARTS: usize = 1;

    /// Moves the applied voltages `state` (V) over a step of `dt` (s) in which the commanded `volts` (V) are constant, and turns those into the
    /// step's mean.
    fn follow(&self, dt: f64, state: &mut [f64], volts: &mut [f64]);
}

/// A law with its state (V), one per actuator.
pub(super) struct Follower<L> {
    law: L,
    state: Vec<f64>,
}

impl<L: Law> Follower<L> {
    /// At 0 V.
    pub(super) fn new(law: L, actuators: usize) -> Self {
        Self { law, state: vec![0.0; actuators] }
    }

    /// The applied voltages (V).
    #[cfg(test)]
    pub(super) fn state(&self) -> &[f64] {
        &self.state
    }
}

impl<L: Law> SignalStage for Follower<L> {
    fn settle(&mut self, volts: &mut [f64]) {
        self.state.copy_from_slice(volts);
    }

    fn pass(&mut self, dt: f64, volts: &mut [f64]) {
        self.law.follow(dt, &mut self.state, volts);
    }

    fn parts(&self) -> usize {
        L::PARTS
    }

    fn memory(&self) -> Vec<f64> {
        self.state.clone()
    }

    fn remember(&mut self, memory: &[f64]) {
        self.state.copy_from_slice(memory);
    }
}
