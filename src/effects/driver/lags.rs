//! First-order lags in parallel.

use crate::effects::SignalStage;

/// `V + Σ w_j (q_j − V)` with `q̇_j = (V − q_j)/T_j`; exact for voltages that are constant over a step.
pub(in crate::effects) struct Lags {
    /// T_j (s) and w_j.
    elements: Vec<[f64; 2]>,
    /// q_j (V), elements × actuators.
    behind: Vec<f64>,
    actuators: usize,
}

impl Lags {
    /// Lags with time constants (s) and weights.
    pub(in crate::effects) fn new(elements: impl Iterator<Item = (f64, f64)>, actuators: usize) -> Self {
        let elements: Vec<[f64; 2]> = elements.map(|(time, weight)| [time, weight]).collect();
        Self { behind: vec![0.0; elements.len() * actuators], elements, actuators }
    }
}

impl SignalStage for Lags {
    fn settle(&mut self, volts: &mut [f64]) {
        self.behind.chunks_exact_mut(self.actuators).for_each(|q| q.copy_from_slice(volts));
    }

    fn pass(&mut self, dt: f64, volts: &mut [f64]) {
        for (i, volts) in volts.iter_mut().enumerate() {
            let mut away = 0.0;
            for ([time, weight], q) in self.elements.iter().zip(self.behind.chunks_exact_mut(self.actuators)) {
                let steps = dt / time;
                let gone = -(-steps).exp_m1();
                let before = q[i] - *volts;
                away += weight * before * gone / steps;
                q[i] = *volts + before * (1.0 - gone);
            }
            *volts += away;
        }
    }

    fn memory(&self) -> Vec<f64> {
        self.behind.clone()
    }

    fn remember(&mut self, memory: &[f64]) {
        self.behind.copy_from_slice(memory);
    }
}
