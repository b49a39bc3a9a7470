//! First-order lags in parallel.

use crate::effects::SignalStage;

/// `g V + Σ w_j (q_j − V)` with `q̇_j = (V − q_j)/T_j`; exact for voltages that are constant over a step.
pub(in crate::effects) struct Lags {
    /// g.
    gain: f64,
    /// T_j (s) and w_j.
    elements: Vec<[f64; 2]>,
    /// q_j (V), elements × actuators.
    behind: Vec<f64>,
    actuators: usize,
    /// The last step (s), and of every element 1 − e^(−Δt/T_j) and the mean of e^(−t/T_j) over it.
    step: f64,
    decays: Vec<[f64; 2]>,
}

impl Lags {
    /// `V + Σ w_j (q_j − V)`: lags with time constants (s) and weights, by which the voltage comes later.
    pub(in crate::effects) fn new(elements: impl Iterator<Item = (f64, f64)>, actuators: usize) -> Self {
        Self::with_gain(1.0, elements.map(|(time, weight)| [time, weight]).collect(), actuators)
    }

    /// `V + Σ w_j q_j`: the voltage at once, and more with time.
    pub(in crate::effects) fn beside(elements: impl Iterator<Item = (f64, f64)>, actuators: usize) -> Self {
        let elements: Vec<[f64; 2]> = elements.map(|(time, weight)| [time, weight]).collect();
        Self::with_gain(1.0 + elements.iter().map(|[_, weight]| weight).sum::<f64>(), elements, actuators)
    }

    fn with_gain(gain: f64, elements: Vec<[f64; 2]>, actuators: usize) -> Self {
        let decays = vec![[0.0, 1.0]; elements.len()];
        Self { gain, behind: vec![0.0; elements.len() * actuators], elements, actuators, step: 0.0, decays }
    }

    fn set_step(&mut self, dt: f64) {
        if dt == self.step {
            return;
        }
        self.step = dt;
        for ([time, _], decay) in self.elements.iter().zip(&mut self.decays) {
            let steps = dt / time;
            let gone = -(-steps).exp_m1();
            *decay = [gone, gone / steps];
        }
    }
}

impl SignalStage for Lags {
    fn settle(&mut self, volts: &mut [f64]) {
        self.behind.chunks_exact_mut(self.actuators).for_each(|q| q.copy_from_slice(volts));
        volts.iter_mut().for_each(|volts| *volts *= self.gain);
    }

    fn pass(&mut self, dt: f64, volts: &mut [f64]) {
        self.set_step(dt);
        for (i, volts) in volts.iter_mut().enumerate() {
            let mut away = 0.0;
            let elements = self.elements.iter().zip(&self.decays);
            for (([_, weight], [gone, mean]), q) in elements.zip(self.behind.chunks_exact_mut(self.actuators)) {
                let before = q[i] - *volts;
                away += weight * before * mean;
                q[i] = *volts + before * (1.0 - gone);
            }
            *volts = self.gain * *volts + away;
        }
    }

    fn memory(&self) -> Vec<f64> {
        self.behind.clone()
    }

    fn remember(&mut self, memory: &[f64]) {
        self.behind.copy_from_slice(memory);
    }
}
