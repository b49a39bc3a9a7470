//! The residual tests of a diagnosis reject noise as often as they say: once in a thousand.

mod common;

use std::collections::BTreeMap;
use std::f64::consts::PI;

use common::random::Random;
use sfers::diagnose::DiagnoseError;
use sfers::diagnose::plant::{Candidate, Model, Nuisance, Plant, Signal};
use sfers::diagnose::residual_tests::residual_tests;

/// Plants, runs of each, and alarms of a test on every run that a rate of 1/1000 gives in all: 20 ± 4.5, so that 4 to 40 lie within four and a half
/// standard deviations (binomial).
const PLANTS: usize = 5_000;
const RUNS: usize = 4;
const ALARMS: [usize; 2] = [4, 40];

struct Measured {
    signals: Vec<Signal>,
}

impl Plant for Measured {
    fn signals(&self) -> &[Signal] {
        &self.signals
    }

    fn channels(&self) -> Vec<String> {
        vec!["x".into(), "z".into()]
    }

    fn unit(&self) -> &'static str {
        ""
    }

    fn candidates(&self) -> &[Candidate] {
        &[]
    }

    fn predict(&self, _model: &Model, _run: usize, _nuisance: &Nuisance) -> Result<Vec<f64>, DiagnoseError> {
        Ok(Vec::new())
    }
}

/// Clean data: what is measured is what is predicted, with noise.
struct Case {
    name: &'static str,
    rows: usize,
    /// Periods of a wave, or 0 for a ramp.
    periods: f64,
    /// How far rows lie off an even spacing, as a share of it.
    uneven: f64,
    /// Share of values that are missing from the data, and of values that are left out of the fit.
    missing: f64,
    left_out: f64,
}

fn alarms(case: &Case, seed: u64) -> BTreeMap<String, usize> {
    let mut random = Random::new(seed);
    let mut found = BTreeMap::new();
    for _ in 0..PLANTS {
        let (mut signals, mut used, mut residuals) = (Vec::new(), Vec::new(), Vec::new());
        for run in 0..RUNS {
            let swing = 400.0 + 300.0 * run as f64;
            let mut signal = Signal { id: run.to_string(), ..Signal::default() };
            let (mut mask, mut left) = (Vec::new(), Vec::new());
            let times: Vec<f64> =
                (0..case.rows).map(|i| 0.01 * (i as f64 + case.uneven * (random.uniform() - 0.5))).map(|t| t.max(0.0)).collect();
            for channel in 0..2 {
                for (i, t) in times.iter().enumerate() {
                    if random.uniform() < case.missing {
                        continue;
                    }
                    let phase = i as f64 / case.rows as f64;
                    let wave = if case.periods > 0.0 { 1.0 - (2.0 * PI * case.periods * phase).cos() } else { phase };
                    let is_used = random.uniform() >= case.left_out;
                    let noise = random.normal();
                    let outlier = if is_used { 0.0 } else { 40.0 };
                    signal.values.push(0.03 * swing * wave + noise + outlier);
                    signal.sigmas.push(1.0);
                    signal.times.push(*t);
                    signal.channels.push(channel);
                    signal.inputs.push(0.5 * swing * wave);
                    mask.push(is_used);
                    left.push(if is_used { noise } else { 0.0 });
                }
            }
            signals.push(signal);
            used.push(mask);
            residuals.push(left);
        }
        let plant = Measured { signals };
        for test in residual_tests(&plant, &used, &residuals) {
            *found.entry(test.name).or_default() += usize::from(!test.passed);
        }
    }
    found
}

#[test]
fn noise_is_rejected_once_in_a_thousand_cases() {
    let sine = Case { name: "sine", rows: 100, periods: 7.0, uneven: 0.0, missing: 0.0, left_out: 0.0 };
    for (seed, case) in [
        Case { name: "sine", ..sine },
        Case { name: "uneven rows", uneven: 0.9, ..sine },
        Case { name: "missing and left out", missing: 0.2, left_out: 0.3, ..sine },
        Case { name: "few rows", rows: 26, periods: 3.0, ..sine },
        Case { name: "four rows a period, uneven", rows: 64, periods: 16.0, uneven: 0.3, ..sine },
        Case { name: "ramp", periods: 0.0, ..sine },
    ]
    .iter()
    .enumerate()
    {
        let found = alarms(case, 1 + seed as u64);
        println!("{}: {found:?}", case.name);
        let count = if case.periods > 0.0 { 9 } else { 6 };
        assert_eq!(found.len(), count, "{}: {found:?}", case.name);
        for (name, alarms) in found {
            // Across the runs there is one test for a plant: 5 ± 2.2 alarms.
            let [least, most] = if name == "gain against amplitude" { [0, 15] } else { ALARMS };
            assert!((least..=most).contains(&alarms), "{}, {name}: {alarms} alarms", case.name);
        }
    }
}
