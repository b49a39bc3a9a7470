//! Domains keep switching slowly after a change of voltage.
//!
//! ```text
//! θ_V = −γ·ℓ·(V + c·Σ q_j),  q̇_j = (V − q_j)/T_j,  T_j = 10^j s from 0.1 s on
//! ```

use crate::effects::{Action, Effect, Kind, Parameter, Voltages};

/// See the file's head.
pub const CREEP: Effect = Effect {
    id: "creep",
    kind: Kind::Actuation,
    cause: "Domains keep switching slowly after a change of voltage.",
    equation: "θ_V = −γ·ℓ·(V + c·Σ q_j),  q̇_j = (V − q_j)/T_j,  T_j = 10^j s from 0.1 s on",
    source: "Physik Instrumente, piezo tutorial; creep of soft PZT and LIPCA benders: Beck et al.; lag derived.",
    parameters: &[Parameter {
        name: "per_decade",
        unit: "1/decade",
        bounds: [-0.2, 0.3],
        off: Some(0.0),
        default: None,
        about: "growth c of the step response per decade of time",
    }],
    action: Action::Voltages(|p, n, duration| Box::new(Creep { per_decade: p[0], behind: vec![vec![0.0; n]; rungs(duration)] })),
};

/// Rungs of the ladder in a run of `duration` (s): as long as a time constant is below three times that.
fn rungs(duration: f64) -> usize {
    (0..).find(|rung| time(*rung) > 3.0 * duration).unwrap_or(0).max(1)
}

/// Time constants (s) of the ladder: 0.1 s and ten times as long from rung to rung.
fn time(rung: usize) -> f64 {
    0.1 * 10_f64.powi(rung as i32)
}

struct Creep {
    per_decade: f64,
    /// q_j of every actuator.
    behind: Vec<Vec<f64>>,
}

impl Voltages for Creep {
    /// What has crept before is part of the settled shape: q_j = V.
    fn settle(&mut self, volts: &mut [f64]) {
        self.behind.iter_mut().for_each(|q| q.copy_from_slice(volts));
        volts.iter_mut().for_each(|v| *v *= 1.0 + self.per_decade * self.behind.len() as f64);
    }

    fn pass(&mut self, dt: f64, volts: &mut [f64]) {
        for (i, volts) in volts.iter_mut().enumerate() {
            let mut crept = 0.0;
            for (rung, q) in self.behind.iter_mut().enumerate() {
                let steps = dt / time(rung);
                let gone = -(-steps).exp_m1();
                let away = q[i] - *volts;
                crept += *volts + away * gone / steps;
                q[i] = *volts + away * (1.0 - gone);
            }
            *volts += self.per_decade * crept;
        }
    }

    fn memory(&self) -> Vec<f64> {
        self.behind.concat()
    }

    fn remember(&mut self, memory: &[f64]) {
        self.behind.iter_mut().flatten().zip(memory).for_each(|(q, kept)| *q = *kept);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_grows_by_the_same_amount_in_every_decade() {
        let Action::Voltages(make) = CREEP.action else { unreachable!() };
        let mut creep = make(&[0.02], 1, 100.0);
        creep.settle(&mut [0.0]);
        let (dt, mut at) = (1e-3, Vec::new());
        for step in 1..=30_000 {
            let mut volts = [1000.0];
            creep.pass(dt, &mut volts);
            if [300, 3_000, 30_000].contains(&step) {
                at.push(volts[0]);
            }
        }
        // 0.02 of 1000 V per decade; a ladder of one rung per decade ripples by a few per cent.
        for pair in at.windows(2) {
            assert!((pair[1] - pair[0] - 20.0).abs() < 1.0, "{at:?}");
        }
    }
}
