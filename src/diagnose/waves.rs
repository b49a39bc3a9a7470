//! A plant for tests: sums of waves with noise.

use super::DiagnoseError;
use super::dataset::Role;
use super::plant::{Candidate, Free, Model, Nuisance, Plant, Signal, Term};
use super::search::Search;
use super::split::split;

/// Sums of waves with noise; the candidates `first` and `second` are nearly collinear.
pub(super) struct Waves {
    pub(super) signals: Vec<Signal>,
    pub(super) candidates: Vec<Candidate>,
    /// Above 1 they add the wave `other` with an amplitude of what they exceed 1 by.
    pub(super) resolutions: Vec<f64>,
    /// Constants within this, over the resolution, are within the error of the discretisation.
    pub(super) tolerance: f64,
    /// Amplitude of the wave `late` that a share of 0 adds to a model, per amplitude of its wave `other`; 0 for runs without shares.
    pub(super) lateness: f64,
    /// Work of a prediction with any cause; 1 without.
    pub(super) work: u64,
}

const VALUES: usize = 400;

fn wave(id: &str, run: usize, at: usize) -> f64 {
    let t = at as f64 / VALUES as f64 + 0.1 * run as f64;
    match id {
        "first" => (7.0 * t).sin(),
        "second" => -(7.0 * t + 0.12).sin(),
        // Hidden in the first run only.
        "once" if run > 0 => 0.0,
        // The same in all runs.
        "offset" => 1.0,
        "late" => (3.0 * t).cos(),
        "between" => wave("other", run, at) + 0.6 * wave("first", run, at),
        "near" => wave("other", run, at) + 0.3 * wave("first", run, at),
        _ => (23.0 * t).cos(),
    }
}

/// What a cause does; `limit` takes what is above 1/x from the wave `other` with an amplitude of 3.
fn part(id: &str, x: f64, run: usize, at: usize) -> f64 {
    if id == "limit" { -(3.0 * wave("other", run, at) - 1.0 / x).max(0.0) } else { x * wave(id, run, at) }
}

/// A power law of what doubles: its size and its exponent lie in a curved valley of χ².
pub(super) fn power(size: f64, exponent: f64, at: usize) -> f64 {
    size * 10_f64.powf(exponent * (0.3 * at as f64 / VALUES as f64 - 1.3))
}

/// A cause with one parameter, 0 for none.
pub(super) fn candidate(id: &'static str) -> Candidate {
    Candidate {
        id,
        kind: "test",
        cause: "A wave.",
        places: vec!["test"],
        is_free_form: false,
        is_variant: false,
        is_constant: false,
        parameters: vec![Free { name: "x", unit: "", off: Some(0.0), bounds: [-100.0, 100.0], scale: 1.0, inverse: false }],
        fixed: Vec::new(),
        starts: vec![vec![1.0]],
    }
}

impl Waves {
    pub(super) fn new(of: &[(&str, f64)]) -> Self {
        Self::with_runs(of, 6)
    }

    pub(super) fn with_runs(of: &[(&str, f64)], runs: usize) -> Self {
        let signal = |run: usize| {
            let value = |at: usize| {
                let noise = (1.0 + (run * VALUES + at) as f64).sin() * 43_758.545_3;
                // Uniform noise of unit variance.
                let noise = (noise - noise.floor() - 0.5) * 12_f64.sqrt();
                of.iter().map(|(id, x)| part(id, *x, run, at)).sum::<f64>() + noise
            };
            Signal {
                id: format!("run {run}"),
                values: (0..VALUES).map(value).collect(),
                sigmas: vec![1.0; VALUES],
                times: (0..VALUES).map(|at| at as f64).collect(),
                channels: vec![0; VALUES],
                inputs: (0..VALUES).map(|at| (at as f64 * (1.0 + run as f64) / 50.0).sin()).collect(),
                ..Signal::default()
            }
        };
        let mut candidates = ["other", "first", "second"].map(candidate).to_vec();
        // Another law of the second cause, with a part of the other one.
        let mut variant = candidate("second");
        variant.is_variant = true;
        variant.parameters.push(Free { name: "y", ..variant.parameters[0] });
        variant.starts = vec![vec![1.0, 1.0]];
        candidates.push(variant);
        Self {
            signals: (0..runs).map(signal).collect(),
            candidates,
            resolutions: vec![1.0],
            tolerance: 0.0,
            lateness: 0.0,
            work: 1,
        }
    }
}

impl Plant for Waves {
    fn signals(&self) -> &[Signal] {
        &self.signals
    }

    fn channels(&self) -> Vec<String> {
        vec!["y".into()]
    }

    fn unit(&self) -> &'static str {
        ""
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    fn work(&self, model: &Model, _run: usize) -> u64 {
        if model.terms.is_empty() { 1 } else { self.work }
    }

    fn nuisances(&self, _run: usize) -> usize {
        usize::from(self.lateness > 0.0)
    }

    fn predict(&self, model: &Model, run: usize, nuisance: &Nuisance) -> Result<Vec<f64>, DiagnoseError> {
        let of = |term: &Term, at| {
            if self.candidates[term.candidate].id == "power" {
                return power(term.x[0], term.x[1], at);
            }
            let more = term.x.get(1).map_or(0.0, |y| y * wave("other", run, at));
            part(self.candidates[term.candidate].id, term.x[0], run, at) + more
        };
        let finer = model.resolution - 1.0;
        let own = |term: &Term| if self.candidates[term.candidate].id == "other" { term.x[0] } else { 0.0 };
        let other = |term: &Term| own(term) + term.x.get(1).unwrap_or(&0.0);
        let late = nuisance.shares.first().map_or(0.0, |share| (1.0 - share) * self.lateness);
        let late = late * model.terms.iter().map(other).sum::<f64>();
        let value = |at| {
            let terms = model.terms.iter().map(|term| of(term, at)).sum::<f64>();
            terms + finer * wave("other", run, at) + late * wave("late", run, at)
        };
        Ok((0..VALUES).map(value).collect())
    }

    fn is_credible(&self, term: &Term, resolution: f64) -> bool {
        !self.candidates[term.candidate].is_constant || term.x[0].abs() > self.tolerance / resolution
    }

    fn resolutions(&self) -> Vec<f64> {
        self.resolutions.clone()
    }
}

/// A search in a plant, from nothing.
pub(super) fn search(plant: &Waves) -> Search<'_> {
    let split = split(plant, &[Role::Auto; 6]);
    Search::new(plant, split, &|_: &str| {})
}
