//! From a place to a name, on a plant small enough to be seen through: a curve of the input, then a first-order lag, then noise.
//!
//! ```text
//! ẏ = (u + c(u) − y)/T,  u = A·sin(2π·f·t)
//! ```
//!
//! The nominal model has c = 0 and T = 0.1 s. "Measured" runs come from Runge and Kutta's rule in small steps, the plant's predictions from exponential steps
//! with the input in the middle of each. Noise: twelve uniform numbers less six by a linear congruential generator of the given seed.

use std::f64::consts::PI;

use sfers::diagnose::DiagnoseError;
use sfers::diagnose::diagnosis::{Adopted, Diagnosis, Part, Verdict};
use sfers::diagnose::pipeline::diagnose;
use sfers::diagnose::plant::{Candidate, Free, FreeCurve, Model, Nuisance, Plant, Signal, Term};

const NOISE: f64 = 0.004;
const ROWS: usize = 300;
const STEP: f64 = 0.02;
const LAG: f64 = 0.1;
/// Amplitudes and frequencies (Hz).
const DRIVES: [(f64, f64); 8] = [(0.3, 0.5), (1.0, 0.3), (0.6, 1.0), (1.0, 1.5), (0.45, 0.7), (0.8, 2.0), (0.9, 0.8), (0.7, 1.3)];

struct Bent {
    signals: Vec<Signal>,
    candidates: Vec<Candidate>,
}

fn input((amplitude, frequency): (f64, f64), t: f64) -> f64 {
    amplitude * (2.0 * PI * frequency * t).sin()
}

/// Hats at the fifths of 1, odd.
fn hats(weights: &[f64], u: f64) -> f64 {
    let at = 5.0 * u.abs();
    let hat = |k: usize| (1.0 - (at - (k + 1) as f64).abs()).max(0.0);
    u.signum() * weights.iter().enumerate().map(|(k, weight)| weight * hat(k)).sum::<f64>()
}

impl Bent {
    fn new(curve: &dyn Fn(f64) -> f64, lag: f64, seed: u64) -> Self {
        let mut seed = seed;
        let mut uniform = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut signals = Vec::new();
        for (run, drive) in DRIVES.iter().enumerate() {
            let rate = |t: f64, y: f64| (input(*drive, t) + curve(input(*drive, t)) - y) / lag;
            let (mut y, h) = (0.0, STEP / 10.0);
            let mut values = Vec::new();
            for row in 0..ROWS {
                values.push(y + NOISE * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0));
                for part in 0..10 {
                    let t = row as f64 * STEP + f64::from(part) * h;
                    let k1 = rate(t, y);
                    let k2 = rate(t + 0.5 * h, y + 0.5 * h * k1);
                    let k3 = rate(t + 0.5 * h, y + 0.5 * h * k2);
                    let k4 = rate(t + h, y + h * k3);
                    y += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
                }
            }
            let times: Vec<f64> = (0..ROWS).map(|row| row as f64 * STEP).collect();
            signals.push(Signal {
                id: format!("run {}", run + 1),
                values,
                sigmas: vec![NOISE; ROWS],
                inputs: times.iter().map(|t| input(*drive, *t)).collect(),
                times,
                channels: vec![0; ROWS],
                ..Signal::default()
            });
        }
        Self { signals, candidates: candidates() }
    }
}

fn free(name: &'static str, off: Option<f64>, bounds: [f64; 2], scale: f64) -> Free {
    Free { name, unit: "", off, bounds, scale, inverse: false }
}

fn candidate(id: &'static str, place: &'static str, parameters: Vec<Free>, starts: Vec<Vec<f64>>) -> Candidate {
    Candidate {
        id,
        kind: "test",
        cause: "A cause.",
        places: vec![place],
        is_free_form: false,
        is_variant: false,
        is_constant: false,
        parameters,
        fixed: Vec::new(),
        starts,
    }
}

/// Two causes that with equal factors are a power of 3.
fn halves() -> [Candidate; 2] {
    let half = |id, place| candidate(id, place, vec![free("factor", Some(0.0), [-2.0, 2.0], 0.1)], vec![vec![0.1]]);
    [half("cube-above", "above"), half("cube-below", "below")]
}

fn candidates() -> Vec<Candidate> {
    let weight = |name| free(name, Some(0.0), [-2.0, 2.0], 0.05);
    let unit = |k: usize| (0..5).map(|at| if at == k { 0.1 } else { 0.0 }).collect::<Vec<f64>>();
    vec![
        Candidate {
            is_constant: true,
            ..candidate("lag", "lag", vec![free("scale", Some(1.0), [0.2, 5.0], 0.1)], vec![vec![1.1]])
        },
        candidate("power", "curve", vec![free("factor", Some(0.0), [-2.0, 2.0], 0.1)], vec![vec![0.1]]),
        Candidate {
            is_variant: true,
            ..candidate(
                "power",
                "curve",
                vec![free("factor", Some(0.0), [-2.0, 2.0], 0.1), free("exponent", None, [0.2, 6.0], 0.3)],
                vec![vec![0.1, 1.5]],
            )
        },
        candidate("polarity", "curve", vec![free("excess", Some(0.0), [-2.0, 2.0], 0.1)], vec![vec![0.1]]),
        candidate("offset", "picture", vec![free("shift", Some(0.0), [-1.0, 1.0], 0.05)], vec![vec![0.02]]),
        Candidate {
            is_free_form: true,
            ..candidate("free-curve", "curve", ["1", "2", "3", "4", "5"].map(weight).to_vec(), (0..5).map(unit).collect())
        },
    ]
}

impl Plant for Bent {
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

    fn curve(&self, term: &Term) -> Option<FreeCurve> {
        let points = (0..=20).map(|k| 0.05 * f64::from(k)).map(|u| [u, hats(&term.x, u)]).collect();
        self.candidates[term.candidate].is_free_form.then_some(FreeCurve { x: ["u", ""], y: ["c", ""], points })
    }

    fn predict(&self, model: &Model, run: usize, _nuisance: &Nuisance) -> Result<Vec<f64>, DiagnoseError> {
        let of =
            |id: &str| model.terms.iter().find(|term| self.candidates[term.candidate].id == id).map(|term| term.x.as_slice());
        let lag = LAG * of("lag").map_or(1.0, |x| x[0]);
        let bent = |u: f64| {
            let power = of("power").map_or(0.0, |x| x[0] * u.signum() * u.abs().powf(x.get(1).copied().unwrap_or(3.0)));
            let polarity = of("polarity").map_or(0.0, |x| x[0] * u.max(0.0));
            let of_half = |id: &str, half: f64| of(id).map_or(0.0, |x| x[0] * half.powi(3));
            let halves = of_half("cube-above", u.max(0.0)) + of_half("cube-below", u.min(0.0));
            u + power + polarity + halves + of("free-curve").map_or(0.0, |weights| hats(weights, u))
        };
        let parts = if model.fine { 8 } else { 4 };
        let h = STEP / f64::from(parts);
        let (mut y, mut out) = (0.0, Vec::new());
        for row in 0..ROWS {
            out.push(y + of("offset").map_or(0.0, |x| x[0]));
            for part in 0..parts {
                let t = row as f64 * STEP + (f64::from(part) + 0.5) * h;
                y += (bent(input(DRIVES[run], t)) - y) * -(-h / lag).exp_m1();
            }
        }
        Ok(out)
    }
}

fn diagnosed(curve: impl Fn(f64) -> f64, lag: f64, seed: u64) -> Diagnosis {
    of_plant(&Bent::new(&curve, lag, seed))
}

fn of_plant(plant: &Bent) -> Diagnosis {
    diagnose(plant, "bent", &[], Vec::new(), &|_| {}, &|_| None).unwrap().diagnosis
}

fn causes(d: &Diagnosis) -> Vec<&str> {
    d.effects.iter().filter(|effect| effect.role == Part::Cause).map(|effect| effect.id.as_str()).collect()
}

fn value(effect: &Adopted, name: &str) -> (f64, [f64; 2]) {
    let p = effect.parameters.iter().find(|p| p.name == name).unwrap();
    (p.value, p.ci95.map(|end| end.unwrap_or(f64::NAN)))
}

#[test]
fn nothing_hidden_is_silence() {
    for seed in 1..=5 {
        let d = diagnosed(|_| 0.0, LAG, seed);
        assert_eq!((d.verdict, causes(&d), d.complete), (Verdict::None, vec![], true), "{seed}: {}", d.summary);
    }
}

#[test]
fn the_librarys_own_law_is_named_with_its_value_and_stands_in_every_resample() {
    for seed in 1..=3 {
        let d = diagnosed(|u| 0.2 * u * u * u, LAG, seed);
        assert_eq!((d.verdict, causes(&d)), (Verdict::Named, vec!["power"]), "{seed}: {}", d.summary);
        let (factor, [low, high]) = value(&d.effects[0], "factor");
        assert!((factor - 0.2).abs() < 0.01 && low < high, "{factor}");
        assert!(d.effects[0].stability.is_some_and(|stability| stability >= 0.8), "{:?}", d.effects[0].stability);
        assert_eq!(d.effects[0].parameters.len(), 1);
    }
}

#[test]
fn another_power_is_the_same_cause_by_another_law() {
    for (seed, exponent) in [(1, 1.6), (2, 4.5), (3, 2.2)] {
        let d = diagnosed(|u| 0.2 * u.signum() * u.abs().powf(exponent), LAG, seed);
        assert_eq!((d.verdict, causes(&d)), (Verdict::Named, vec!["power"]), "{seed}: {}", d.summary);
        let (found, [low, high]) = value(&d.effects[0], "exponent");
        assert!((found - exponent).abs() < 0.3 && low < exponent + 0.1 && exponent - 0.1 < high, "{found} {low} {high}");
    }
}

#[test]
fn two_laws_of_one_place_are_both_named() {
    for seed in 1..=3 {
        let d = diagnosed(|u| 0.2 * u * u * u + 0.1 * u.max(0.0), LAG, seed);
        let mut found = causes(&d);
        found.sort_unstable();
        assert_eq!((d.verdict, found), (Verdict::Named, vec!["polarity", "power"]), "{seed}: {}", d.summary);
    }
}

#[test]
fn a_law_that_nobody_wrote_down_is_located_with_its_curve() {
    // A bump at 0.4 that no named law has.
    let law = |u: f64| 0.08 * u.signum() * (-((u.abs() - 0.4) / 0.2_f64).powi(2)).exp() * (u.abs() / 0.2).min(1.0);
    let (mut inside, mut points) = (0, 0);
    for seed in 1..=5 {
        let d = diagnosed(law, LAG, seed);
        assert_eq!((d.verdict, causes(&d)), (Verdict::Located, vec!["free-curve"]), "{seed}: {}", d.summary);
        let found = &d.effects[0];
        assert_eq!(found.place, "curve");
        assert!(found.nearest.iter().all(|name| name.left > 0.05) && !found.nearest.is_empty(), "{:?}", found.nearest);
        let curve = found.curve.as_ref().unwrap();
        for ((u, y), [low, high]) in curve.x.iter().zip(&curve.y).zip(&curve.ci95) {
            assert!((y - law(*u)).abs() < 0.015, "{seed}: {y} at {u}");
            if *u > 0.0 {
                points += 1;
                inside += usize::from(*low <= law(*u) && law(*u) <= *high);
            }
        }
    }
    // Seen: of 100.
    assert!(points == 100 && inside >= 90, "{inside} of {points}");
}

#[test]
fn a_constant_and_a_law_are_told_apart() {
    for seed in 1..=3 {
        let d = diagnosed(|u| 0.2 * u * u * u, 1.3 * LAG, seed);
        let mut found = causes(&d);
        found.sort_unstable();
        assert_eq!((d.verdict, found), (Verdict::Named, vec!["lag", "power"]), "{seed}: {}", d.summary);
    }
}

#[test]
fn two_causes_that_do_what_one_does_are_tied_with_it_as_a_set() {
    for seed in 1..=3 {
        let mut plant = Bent::new(&|u| 0.2 * u * u * u, LAG, seed);
        plant.candidates.extend(halves());
        let d = of_plant(&plant);
        assert_eq!((d.verdict, causes(&d)), (Verdict::Tied, vec!["power"]), "{seed}: {}", d.summary);
        assert_eq!(d.effects[0].tied_with, ["cube-above+cube-below"]);
        assert!(d.summary.contains("cube above") && d.summary.contains("cube below"), "{}", d.summary);
    }
}
