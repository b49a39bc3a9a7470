//! The largest voltages so far leave a remanent polarisation, so a part of the strain stays when the voltage is taken away.
//!
//! ```text
//! θ_V = −γ·ℓ·(V + S(max V) − S(−min V)),  S(u) = V_s·(1 − exp(−r·max(0, u − V_c)/V_s))
//! ```
//!
//! max V and min V are the extremes of an actuator's voltage since the start of the run, at which both are the first voltage. Between them the offset does
//! not change, so it is no loop: it stays until a larger voltage of either sign comes. Without saturation, V_s infinite, S(u) is r·max(0, u − V_c).
//!
//! # Parameters
//! * `share` (–): share r of the voltage beyond the coercive one that stays
//! * `coercive_v` (V): coercive voltage V_c: smaller ones leave nothing
//! * `saturation_v` (V): largest offset V_s of either sign
//!
//! # Source
//! M. Kamlah, Continuum Mech. Thermodyn. 13 (2001) 219: irreversible polarisation from the coercive field on, up to saturation; both signs apart and the exponential are derived.

use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, SignalStage, fits};

/// See the file's head.
pub const REMANENCE: Effect = Effect {
    id: "remanence",
    kind: Kind::Actuation,
    cause: "The largest voltages so far leave a remanent polarisation, so a part of the strain stays when the voltage is taken away.",
    equation: "θ_V = −γ·ℓ·(V + S(max V) − S(−min V)),  S(u) = V_s·(1 − exp(−r·max(0, u − V_c)/V_s))",
    source: "M. Kamlah, Continuum Mech. Thermodyn. 13 (2001) 219: irreversible polarisation from the coercive field on, up to saturation; both signs apart and the exponential are derived.",
    parameters: &[
        Parameter {
            name: "share",
            unit: "",
            bounds: [0.0, 0.5],
            off: Some(0.0),
            default: None,
            about: "share r of the voltage beyond the coercive one that stays",
        },
        Parameter {
            name: "coercive_v",
            unit: "V",
            bounds: [0.0, 1e4],
            off: None,
            default: Some(500.0),
            about: "coercive voltage V_c: smaller ones leave nothing",
        },
        Parameter {
            name: "saturation_v",
            unit: "V",
            bounds: [1.0, 1e5],
            off: None,
            default: Some(f64::INFINITY),
            about: "largest offset V_s of either sign",
        },
    ],
    places: &[Place::VoltageMemory, Place::RestShape],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[Form {
            fitted: &[("share", 0.05), ("coercive_v", 100.0), ("saturation_v", 50.0)],
            starts: &[&[0.1, 200.0, 100.0], &[0.1, 600.0, 100.0]],
            given: &[],
        }],
        forms: &[Form { fitted: &[("share", 0.05), ("coercive_v", 100.0)], starts: &[&[0.1, 200.0], &[0.1, 600.0]], given: &[] }],
    },
    shape: None,
    action: Action::Voltages(|p, n, _| {
        Box::new(Remanence { share: p[0], coercive: p[1], saturation: p[2], extremes: vec![[0.0; 2]; n] })
    }),
};

struct Remanence {
    /// r.
    share: f64,
    /// V_c (V).
    coercive: f64,
    /// V_s (V).
    saturation: f64,
    /// Lowest and highest voltage of every actuator (V).
    extremes: Vec<[f64; 2]>,
}

impl Remanence {
    /// S(u) (V).
    fn left_by(&self, u: f64) -> f64 {
        let linear = self.share * (u - self.coercive).max(0.0);
        if self.saturation.is_finite() { -self.saturation * (-linear / self.saturation).exp_m1() } else { linear }
    }
}

impl SignalStage for Remanence {
    fn settle(&mut self, volts: &mut [f64]) {
        for (extremes, volts) in self.extremes.iter_mut().zip(&*volts) {
            *extremes = [*volts; 2];
        }
        self.pass(0.0, volts);
    }

    fn pass(&mut self, _dt: f64, volts: &mut [f64]) {
        for (i, volts) in volts.iter_mut().enumerate() {
            let [low, high] = self.extremes[i];
            let [low, high] = [low.min(*volts), high.max(*volts)];
            self.extremes[i] = [low, high];
            *volts += self.left_by(high) - self.left_by(-low);
        }
    }

    fn memory(&self) -> Vec<f64> {
        self.extremes.concat()
    }

    fn remember(&mut self, memory: &[f64]) {
        self.extremes.copy_from_slice(memory.as_chunks().0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Outputs at voltages that follow one another.
    fn outputs(values: &[f64], volts: &[f64]) -> Vec<f64> {
        let Action::Voltages(make) = REMANENCE.action else { unreachable!() };
        let mut stage = make(values, 1, 1.0);
        stage.settle(&mut [0.0]);
        let at = |v: &f64| {
            let mut out = [*v];
            stage.pass(1e-3, &mut out);
            out[0]
        };
        volts.iter().map(at).collect()
    }

    #[test]
    fn what_stays_is_the_share_of_the_largest_voltages_beyond_the_coercive_one() {
        let volts = [400.0, 0.0, 1000.0, 0.0, -500.0, 900.0, 0.0, -700.0, 0.0, 1000.0, 1200.0, 0.0];
        let offsets = [0.0, 0.0, 50.0, 50.0, 50.0, 50.0, 50.0, 30.0, 30.0, 30.0, 50.0, 50.0];
        for ((out, volts), offset) in outputs(&[0.1, 500.0, f64::INFINITY], &volts).iter().zip(volts).zip(offsets) {
            assert!((out - volts - offset).abs() < 1e-12, "{out} at {volts}");
        }
    }

    #[test]
    fn it_saturates() {
        let found = outputs(&[0.1, 500.0, 40.0], &[600.0, 0.0, 1e5, 0.0]);
        assert!((found[1] - 40.0 * (1.0 - (-0.25_f64).exp())).abs() < 1e-12 && (found[3] - 40.0).abs() < 1e-9, "{found:?}");
        // A saturation far away is none.
        let far = outputs(&[0.1, 500.0, 1e5], &[1500.0, 0.0]);
        assert!((far[1] / 100.0 - 1.0).abs() < 1e-3, "{far:?}");
    }

    #[test]
    fn a_run_starts_with_what_its_first_voltage_leaves() {
        let Action::Voltages(make) = REMANENCE.action else { unreachable!() };
        let mut stage = make(&[0.1, 500.0, f64::INFINITY], 2, 1.0);
        let mut volts = [1000.0, -700.0];
        stage.settle(&mut volts);
        assert_eq!(volts, [1050.0, -720.0]);
    }
}
