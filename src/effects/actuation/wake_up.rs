//! The first cycles free domains that had aged, so the gain changes with the path that the voltage has gone until it reaches its later value.
//!
//! ```text
//! θ_V = −γ·ℓ·V·(1 + d·exp(−s/s_0)),  s = ∫ |dV|
//! ```
//!
//! s is the path of an actuator's voltage since the start of the run, at which it is 0; a cycle with amplitude A adds 4·A. The later gain is the nominal one.
//!
//! # Parameters
//! * `change` (–): change d of the gain at the start of a run; negative where the first cycle is smaller
//! * `path_kv` (kV): path s_0 after which 1/e of the change is left; a longer one would be another gain
//!
//! # Source
//! De-aging by cycles: Genenko, Glaum, Hoffmann, Albe, Mater. Sci. Eng. B 192 (2015) 52; the exponential is from general knowledge.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, SignalStage, fits};

/// See the file's head.
pub const WAKE_UP: Effect = Effect {
    id: "wake-up",
    kind: Kind::Actuation,
    cause: "The first cycles free domains that had aged, so the gain changes with the path that the voltage has gone until it reaches its later value.",
    equation: "θ_V = −γ·ℓ·V·(1 + d·exp(−s/s_0)),  s = ∫ |dV|",
    source: "De-aging by cycles: Genenko, Glaum, Hoffmann, Albe, Mater. Sci. Eng. B 192 (2015) 52; the exponential is from general knowledge.",
    parameters: &[
        Parameter {
            name: "change",
            unit: "",
            bounds: [-0.5, 0.5],
            off: Some(0.0),
            default: None,
            about: "change d of the gain at the start of a run; negative where the first cycle is smaller",
        },
        Parameter {
            name: "path_kv",
            unit: "kV",
            bounds: [0.01, 30.0],
            off: None,
            default: Some(3.0),
            about: "path s_0 after which 1/e of the change is left; a longer one would be another gain",
        },
    ],
    places: &[Place::VoltageMemory, Place::VoltageCurve],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[],
        forms: &[Form {
            fitted: &[("change", 0.05), ("path_kv", 2.0)],
            starts: &[&[-0.05, 3.0], &[0.05, 3.0], &[-0.05, 20.0]],
            given: &[],
        }],
    },
    shape: None,
    action: Action::Voltages(|p, n, _| {
        Box::new(WakeUp { change: p[0], path: 1e3 * p[1], gone: vec![0.0; n], volts: vec![0.0; n] })
    }),
};

struct WakeUp {
    /// d.
    change: f64,
    /// s_0 (V).
    path: f64,
    /// s of every actuator (V).
    gone: Vec<f64>,
    /// V of every actuator (V).
    volts: Vec<f64>,
}

impl SignalStage for WakeUp {
    fn settle(&mut self, volts: &mut [f64]) {
        self.gone.fill(0.0);
        self.volts.copy_from_slice(volts);
        self.pass(0.0, volts);
    }

    fn pass(&mut self, _dt: f64, volts: &mut [f64]) {
        for ((volts, before), gone) in volts.iter_mut().zip(&mut self.volts).zip(&mut self.gone) {
            *gone += (*volts - *before).abs();
            *before = *volts;
            *volts *= 1.0 + self.change * (-*gone / self.path).exp();
        }
    }

    fn memory(&self) -> Vec<f64> {
        [self.gone.as_slice(), &self.volts].concat()
    }

    fn remember(&mut self, memory: &[f64]) {
        let (gone, volts) = memory.split_at(self.gone.len());
        self.gone.copy_from_slice(gone);
        self.volts.copy_from_slice(volts);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gain_approaches_its_later_value_with_the_path_at_any_rate() {
        let Action::Voltages(make) = WAKE_UP.action else { unreachable!() };
        for steps in [1, 100] {
            let mut stage = make(&[-0.2, 2.0], 1, 1.0);
            let mut first = [300.0];
            stage.settle(&mut first);
            assert!((first[0] - 0.8 * 300.0).abs() < 1e-12, "{first:?}");
            let mut from = 300.0;
            // Paths of 0.7, 1.7 and 2.7 kV.
            for (to, path) in [(1000.0, 0.7), (0.0, 1.7), (-1000.0, 2.7)] {
                let mut out = [0.0];
                for step in 1..=steps {
                    out = [from + (to - from) * f64::from(step) / f64::from(steps)];
                    stage.pass(1e-3, &mut out);
                }
                from = to;
                let expected = to * (1.0 - 0.2 * f64::exp(-path / 2.0));
                assert!((out[0] - expected).abs() < 1e-9, "{} at {to}, not {expected}", out[0]);
            }
        }
    }
}
