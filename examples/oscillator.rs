//! The loop on a plant that has nothing to do with robots: a mass on a spring, pushed by a force, whose spring hardens unknown to the model.
//!
//! ```text
//! x'' + 2 ζ ω x' + ω² x (1 + a x²) = f(t)          nominal: ω = 2π·1.5 /s, ζ = 0.05, a = 0
//! ```
//!
//! "Measured" are eight runs with a = 0.3 by Runge and Kutta's rule at a fine step, with noise. The plant predicts by the Störmer-Verlet rule.

use std::f64::consts::PI;

use sfers::diagnose::DiagnoseError;
use sfers::diagnose::diagnosis::Verdict;
use sfers::diagnose::pipeline::diagnose;
use sfers::diagnose::plant::{Candidate, Free, Model, Nuisance, Plant, Signal};

const OMEGA: f64 = 2.0 * PI * 1.5;
const ZETA: f64 = 0.05;
const NOISE: f64 = 0.01;
const ROWS: usize = 400;
const STEP: f64 = 0.02;

struct Oscillator {
    signals: Vec<Signal>,
    candidates: Vec<Candidate>,
    /// Amplitude (m/s²) and frequency (Hz) of the force in each run.
    forces: Vec<(f64, f64)>,
}

fn force((amplitude, frequency): (f64, f64), t: f64) -> f64 {
    amplitude * (2.0 * PI * frequency * t).sin()
}

/// What was "measured": classic Runge-Kutta in small steps.
fn truth(drive: (f64, f64)) -> Vec<f64> {
    let rate = |t: f64, [x, v]: [f64; 2]| [v, force(drive, t) - 2.0 * ZETA * OMEGA * v - OMEGA * OMEGA * x * (1.0 + 0.3 * x * x)];
    let (mut y, h) = ([0.0; 2], STEP / 20.0);
    let mut out = Vec::new();
    for row in 0..ROWS {
        out.push(y[0]);
        for part in 0..20 {
            let t = row as f64 * STEP + part as f64 * h;
            let move_by = |y: [f64; 2], k: [f64; 2], s: f64| [y[0] + s * k[0], y[1] + s * k[1]];
            let k1 = rate(t, y);
            let k2 = rate(t + 0.5 * h, move_by(y, k1, 0.5 * h));
            let k3 = rate(t + 0.5 * h, move_by(y, k2, 0.5 * h));
            let k4 = rate(t + h, move_by(y, k3, h));
            y = [0, 1].map(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        }
    }
    out
}

impl Oscillator {
    fn new() -> Self {
        let forces = vec![(4.0, 0.4), (12.0, 0.4), (4.0, 1.0), (16.0, 1.0), (3.0, 1.5), (10.0, 1.6), (6.0, 2.2), (24.0, 2.4)];
        // Noise of unit variance by a linear congruential generator, seed 1: twelve uniform numbers less six.
        let mut seed = 1_u64;
        let mut uniform = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut signals = Vec::new();
        for (run, drive) in forces.iter().enumerate() {
            let values: Vec<f64> =
                truth(*drive).iter().map(|x| x + NOISE * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0)).collect();
            let times: Vec<f64> = (0..ROWS).map(|row| row as f64 * STEP).collect();
            signals.push(Signal {
                id: format!("run {}", run + 1),
                values,
                sigmas: vec![NOISE; ROWS],
                inputs: times.iter().map(|t| force(*drive, *t)).collect(),
                times,
                channels: vec![0; ROWS],
                ..Signal::default()
            });
        }
        let candidate = |id, cause, is_constant, name, off: f64, bounds, scale, start: f64| Candidate {
            id,
            kind: if is_constant { "calibration" } else { "structure" },
            cause,
            places: vec![id],
            is_free_form: false,
            is_variant: false,
            is_constant,
            parameters: vec![Free { name, unit: "", off: Some(off), bounds, scale, inverse: false }],
            fixed: Vec::new(),
            starts: vec![vec![start]],
        };
        let candidates = vec![
            candidate("spring", "The spring is stiffer or softer.", true, "scale", 1.0, [0.5, 2.0], 0.1, 1.1),
            candidate("loss", "The damper is stronger or weaker.", true, "scale", 1.0, [0.1, 10.0], 0.2, 1.5),
            candidate("gain", "The force is scaled.", true, "scale", 1.0, [0.5, 2.0], 0.1, 1.1),
            candidate("hardening", "The spring hardens with deflection.", false, "per_m2", 0.0, [-1.0, 1.0], 0.1, 0.1),
            candidate("square-drag", "Drag grows with the square of the speed.", false, "per_m", 0.0, [0.0, 2.0], 0.05, 0.05),
            candidate("offset", "The sensor's zero is off.", false, "m", 0.0, [-1.0, 1.0], 0.05, 0.02),
        ];
        Self { signals, candidates, forces }
    }
}

impl Plant for Oscillator {
    fn signals(&self) -> &[Signal] {
        &self.signals
    }

    fn channels(&self) -> Vec<String> {
        vec!["x".into()]
    }

    fn unit(&self) -> &'static str {
        "m"
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    fn predict(&self, model: &Model, run: usize, _nuisance: &Nuisance) -> Result<Vec<f64>, DiagnoseError> {
        let value = |id: &str, nominal: f64| {
            model.terms.iter().find(|term| self.candidates[term.candidate].id == id).map_or(nominal, |term| term.x[0])
        };
        let (spring, loss, gain) = (value("spring", 1.0), value("loss", 1.0), value("gain", 1.0));
        let (hardening, drag, offset) = (value("hardening", 0.0), value("square-drag", 0.0), value("offset", 0.0));
        let parts = if model.fine { 40 } else { 20 };
        let (mut x, mut v, h) = (0.0_f64, 0.0_f64, STEP / f64::from(parts));
        let mut out = Vec::new();
        for row in 0..ROWS {
            out.push(x + offset);
            for part in 0..parts {
                let t = row as f64 * STEP + f64::from(part) * h;
                x += 0.5 * h * v;
                let pull = gain * force(self.forces[run], t + 0.5 * h)
                    - spring * OMEGA * OMEGA * x * (1.0 + hardening * x * x)
                    - drag * v * v.abs();
                let half = ZETA * loss * OMEGA * h;
                v = ((1.0 - half) * v + h * pull) / (1.0 + half);
                x += 0.5 * h * v;
            }
        }
        if out.iter().all(|x| x.is_finite()) { Ok(out) } else { Err("it ran away".into()) }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let outcome = diagnose(&Oscillator::new(), "oscillator", &[], Vec::new(), &|_| {}, &|_| None)?;
    let d = &outcome.diagnosis;
    println!("{}", d.summary);
    println!(
        "held-out error: nominal {:.4} m, re-tuned {:.4} m, extended {:.4} m",
        d.baseline.rmse_heldout_mm, d.calibrated.rmse_heldout_mm, d.extended.rmse_heldout_mm
    );
    if d.verdict != Verdict::Named || d.effects[0].id != "hardening" {
        return Err(format!("expected the hardening spring, found {:?}", d.effects).into());
    }
    Ok(())
}
