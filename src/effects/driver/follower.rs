//! Drivers whose state is the applied voltage of each actuator.

use crate::effects::SignalStage;

/// How the applied voltages follow the commanded ones.
pub(super) trait Law: Send {
    /// See [`SignalStage::parts`].
    const PARTS: usize = 1;

    /// See [`SignalStage::parts_between`]; `state` are the applied voltages (V).
    fn parts_between(&self, _dt: f64, _state: &[f64], _from: &[f64], _to: &[f64]) -> usize {
        Self::PARTS
    }

    /// Moves the applied voltages `state` (V) over a step of `dt` (s) in which the commanded `volts` (V) are constant, and turns those into the
    /// step's mean. The middle of the step is `since` (s) after that of the last one.
    fn follow(&self, dt: f64, since: f64, state: &mut [f64], volts: &mut [f64]);
}

/// A law with its state (V), one per actuator.
pub(super) struct Follower<L> {
    law: L,
    state: Vec<f64>,
    /// Length of the last step (s); 0 at rest.
    last: f64,
}

impl<L: Law> Follower<L> {
    /// At 0 V.
    pub(super) fn new(law: L, actuators: usize) -> Self {
        Self { law, state: vec![0.0; actuators], last: 0.0 }
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
        self.last = 0.0;
    }

    fn pass(&mut self, dt: f64, volts: &mut [f64]) {
        self.law.follow(dt, 0.5 * (self.last + dt), &mut self.state, volts);
        self.last = dt;
    }

    fn parts(&self) -> usize {
        L::PARTS
    }

    fn parts_between(&self, dt: f64, from: &[f64], to: &[f64]) -> usize {
        self.law.parts_between(dt, &self.state, from, to)
    }

    fn memory(&self) -> Vec<f64> {
        [&self.state[..], &[self.last]].concat()
    }

    fn remember(&mut self, memory: &[f64]) {
        let (state, last) = memory.split_at(self.state.len());
        self.state.copy_from_slice(state);
        self.last = last[0];
    }
}
