//! The diagnosis on measurements: a piezo stack in a flexure, driven by an amplifier, with a capacitive displacement sensor.
//!
//! ```text
//! T y' + y = g u(t) + y₀        nominal: g = 13 µm/V, T = 10 ms, y₀ = −121 µm
//! ```
//!
//! u is the amplifier's input (0 to 3.6 V), 200 rows a second. Two sessions: 40 cycles of a 1 Hz sine of full stroke, and sines of falling and rising
//! amplitude, from row 7400 on through the authors' inverse model. Before each the input was 0 V: y jumps with the first row's input. The zero of the
//! sensor differs between sessions and is a constant of its own. Runs are stretches of a session; every prediction starts at the session's first row.
//! σ is what the sensor shows at rest, less its trend.
//!
//! A. M. Aye, W. T. Ang, "Discrete backlash operator", ICSTSD 2018; data in yan9a/DiscreteBacklashOperator.
//!
//! ```sh
//! cargo run --release --example piezo_stack -- ../shared/real    # the folder that holds piezo-stack/full-stroke.npz and minor-loops.npz
//! ```

#[path = "measured/common.rs"]
mod common;

use std::error::Error;
use std::path::Path;

use common::{at, candidate, column, constant, folder, found, free, one, print, shape};
use sfers::diagnose::DiagnoseError;
use sfers::diagnose::dataset::Role;
use sfers::diagnose::pipeline::Outcome;
use sfers::diagnose::plant::{Candidate, Model, Nuisance, Plant, Signal};

const INTERVAL_S: f64 = 0.005;
/// Largest input (V).
const STROKE_V: f64 = 3.6;
/// Rows of the second session at rest.
const REST: [usize; 2] = [4_200, 5_000];
/// Thresholds of plays, as shares of half the stroke.
const PLAYS: usize = 12;
/// Time constants of creep (s).
const CREEP_S: [f64; 7] = [0.1, 0.316, 1.0, 3.16, 10.0, 31.6, 100.0];

/// Stretches: session, first and last row, name, whether it is fitted or held out.
const STRETCHES: [(usize, usize, usize, &str, Role); 14] = [
    (0, 0, 200, "full stroke, first cycle", Role::Fit),
    (0, 200, 800, "full stroke, cycles 2 to 4", Role::Fit),
    (0, 1_800, 2_600, "full stroke, cycles 10 to 13", Role::HeldOut),
    (0, 7_200, 8_000, "full stroke, cycles 37 to 40", Role::Fit),
    (1, 0, 200, "session 2, first cycle", Role::HeldOut),
    (1, 200, 800, "session 2, cycles 2 to 4", Role::HeldOut),
    (1, 2_600, 3_200, "session 2, cycles 14 to 16", Role::Fit),
    (1, 3_200, 4_200, "session 2, falling", Role::Fit),
    (1, 4_200, 5_000, "session 2, at rest", Role::HeldOut),
    (1, 5_000, 6_000, "session 2, rising", Role::HeldOut),
    (1, 6_600, 7_400, "session 2, before the inverse", Role::HeldOut),
    (1, 7_400, 8_200, "inverse, constant", Role::HeldOut),
    (1, 9_400, 10_400, "inverse, falling", Role::HeldOut),
    (1, 11_200, 12_200, "inverse, rising", Role::Fit),
];

/// The stack's two sessions.
pub struct Stack {
    signals: Vec<Signal>,
    candidates: Vec<Candidate>,
    /// Inputs (V) of each session.
    inputs_v: Vec<Vec<f64>>,
}

fn candidates() -> Vec<Candidate> {
    let number = |name, unit, bound: f64, scale| free(name, unit, 0.0, [-bound, bound], scale);
    let share = || free("share_of_plays", "", 0.0, [0.0, 0.9], 0.02);
    let plays = |parameters: Vec<_>, fixed: &[(&'static str, f64)], starts: &[&[f64]]| Candidate {
        fixed: fixed.to_vec(),
        ..candidate("hysteresis", "The displacement depends on the inputs before.", parameters, starts)
    };
    let constants = vec![
        constant("gain", "Displacement per volt differs.", free("gain", "µm/V", 13.0, [5.0, 30.0], 0.3)),
        constant("lag", "The amplifier or sensor is faster or slower.", free("time", "ms", 10.0, [0.5, 100.0], 1.0)),
        constant("zero", "The sensor's zero in the first session.", free("zero", "µm", -121.0, [-200.0, 0.0], 1.0)),
        constant("zero-of-session-2", "The sensor's zero moved between sessions.", number("shift", "µm", 50.0, 1.0)),
    ];
    [
        constants,
        at(
            "memory-of-the-input",
            [
                plays(
                    vec![share(), shape("decay", "1/V", [-3.0, 5.0], 0.2)],
                    &[("plays", PLAYS as f64), ("from_zero", 1.0)],
                    &[&[0.1, 0.5], &[0.1, 2.0]],
                ),
                plays(
                    vec![share(), shape("beta", "1/V", [0.05, 10.0], 0.1), shape("gamma", "1/V", [-5.0, 5.0], 0.1)],
                    &[("plays", 0.0)],
                    &[&[0.1, 0.5, 0.3], &[0.1, 1.5, 0.5]],
                ),
                one(
                    "remanence",
                    "A part of the displacement at the largest input so far stays (wake-up).",
                    "shift",
                    "µm",
                    [-20.0, 20.0],
                    0.3,
                ),
            ],
        ),
        at(
            "memory-in-time",
            [
                one("creep", "The displacement creeps.", "per_decade", "", [-0.2, 0.2], 0.002),
                one("drift", "The set-up drifts.", "rate", "µm/s", [-1.0, 1.0], 0.01),
            ],
        ),
        at(
            "gain",
            [candidate(
                "field-dependent-gain",
                "The gain depends on the input.",
                vec![number("slope", "1/V", 0.3, 0.005), number("curvature", "1/V²", 0.1, 0.002)],
                &[&[0.01, 0.0], &[0.0, 0.01]],
            )],
        ),
        at(
            "sensor",
            [candidate(
                "sensor-curvature",
                "The sensor's gain depends on displacement.",
                vec![number("slope", "1/mm", 20.0, 0.2), number("curvature", "1/mm²", 500.0, 5.0)],
                &[&[0.5, 0.0], &[0.0, 10.0]],
            )],
        ),
        at(
            "amplifier",
            [
                one("saturation", "The amplifier's output is limited.", "lost_range", "V", [0.0, 2.0], 0.05),
                one("delay", "The displacement follows late.", "time", "ms", [0.0, 40.0], 1.0),
            ],
        ),
    ]
    .concat()
}

/// Standard deviation about a straight line.
fn scatter(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let (middle, mean) = (0.5 * (n - 1.0), values.iter().sum::<f64>() / n);
    let slope = (0..).zip(values).map(|(i, v)| (f64::from(i) - middle) * v).sum::<f64>() * 12.0 / (n * (n * n - 1.0));
    let squares = (0..).zip(values).map(|(i, v)| (v - mean - slope * (f64::from(i) - middle)).powi(2));
    (squares.sum::<f64>() / (n - 2.0)).sqrt()
}

impl Stack {
    /// Reads both sessions.
    ///
    /// # Errors
    /// If a file is not such a record.
    pub fn read(folder: &Path) -> Result<Self, Box<dyn Error>> {
        let (mut inputs_v, mut measured) = (Vec::new(), Vec::new());
        for name in ["full-stroke.npz", "minor-loops.npz"] {
            inputs_v.push(column(&folder.join(name), "input_v")?);
            measured.push(column(&folder.join(name), "displacement_um")?);
        }
        let sigma = scatter(&measured[1][REST[0]..REST[1]]);
        let signal = |(session, from, to, name, _): &(usize, usize, usize, &str, Role)| Signal {
            id: (*name).to_owned(),
            values: measured[*session][*from..*to].to_vec(),
            sigmas: vec![sigma; to - from],
            times: (0..to - from).map(|row| row as f64 * INTERVAL_S).collect(),
            channels: vec![0; to - from],
            inputs: inputs_v[*session][*from..*to].to_vec(),
            ..Signal::default()
        };
        Ok(Self { signals: STRETCHES.iter().map(signal).collect(), candidates: candidates(), inputs_v })
    }
}

impl Plant for Stack {
    fn signals(&self) -> &[Signal] {
        &self.signals
    }

    fn channels(&self) -> Vec<String> {
        vec!["displacement".into()]
    }

    fn unit(&self) -> &'static str {
        "µm"
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    /// Two sessions, not fourteen: what differs between them is a constant, not a fault of each run.
    fn bench(&self) -> [Option<f64>; 6] {
        [Some(0.0); 6]
    }

    fn predict(&self, model: &Model, run: usize, _nuisance: &Nuisance) -> Result<Vec<f64>, DiagnoseError> {
        let value = |id: &str, name: &str| common::value(&self.candidates, model, id, name);
        let effect = |id: &str, name: &str| value(id, name).unwrap_or(0.0);
        let (session, from, to, ..) = STRETCHES[run];
        let gain = value("gain", "gain").unwrap_or(13.0);
        let zero =
            value("zero", "zero").unwrap_or(-121.0) + if session == 1 { effect("zero-of-session-2", "shift") } else { 0.0 };
        let lag_s = 1e-3 * value("lag", "time").unwrap_or(10.0);
        let (width, decay) = (effect("hysteresis", "share_of_plays"), value("hysteresis", "decay"));
        let (beta, gamma) = (effect("hysteresis", "beta"), effect("hysteresis", "gamma"));
        let (slope, curvature) = (effect("field-dependent-gain", "slope"), effect("field-dependent-gain", "curvature"));
        let (sensor_1, sensor_2) = (1e-3 * effect("sensor-curvature", "slope"), 1e-6 * effect("sensor-curvature", "curvature"));
        let limit_v = STROKE_V - effect("saturation", "lost_range");
        let late_rows = 1e-3 * effect("delay", "time") / INTERVAL_S;
        let (creep, remanence, drift) = (effect("creep", "per_decade"), effect("remanence", "shift"), effect("drift", "rate"));

        let thresholds: [f64; PLAYS] = std::array::from_fn(|k| (k + 1) as f64 / (PLAYS + 1) as f64 * 0.5 * STROKE_V);
        let mut weights = thresholds.map(|r| decay.map_or(0.0, |decay| (-decay * r).exp()));
        let sum = weights.iter().sum::<f64>().max(1e-300);
        weights.iter_mut().for_each(|weight| *weight /= sum);
        let (mut plays, mut loops) = ([0.0_f64; PLAYS], 0.0_f64);
        let follow = CREEP_S.map(|time| 1.0 - (-INTERVAL_S / time).exp());
        let (mut slow, mut largest, mut before) = ([0.0_f64; CREEP_S.len()], 0.0_f64, 0.0_f64);
        let mut lagged = 0.0_f64;
        let input = &self.inputs_v[session];
        let mut out = Vec::with_capacity(to - from);
        for row in 0..to {
            let at = row as f64 - late_rows;
            // 0 V before the first row.
            let sample = |k: f64| if k < 0.0 { 0.0 } else { input[k as usize] };
            let u = (sample(at.floor()) + at.rem_euclid(1.0) * (sample(at.floor() + 1.0) - sample(at.floor()))).min(limit_v);
            // As hysteresis and field make it (V).
            let mut effective = u;
            if width > 0.0 && decay.is_some() {
                let mut sum = 0.0;
                for ((play, threshold), weight) in plays.iter_mut().zip(&thresholds).zip(&weights) {
                    *play = play.clamp(u - threshold, u + threshold);
                    sum += weight * *play;
                }
                effective = (1.0 - width) * u + width * sum;
            } else if width > 0.0 {
                // Bouc and Wen's law of first power in parts of a row, a loop that saturates at 1/(beta + gamma).
                for _ in 0..4 {
                    let step = 0.25 * (u - before);
                    loops += step - (beta * step.abs() * loops + gamma * step * loops.abs());
                }
                effective = u - width * loops;
            }
            before = u;
            effective *= 1.0 + slope * (u - 0.5 * STROKE_V) + curvature * (u - 0.5 * STROKE_V).powi(2);
            for (slow, follow) in slow.iter_mut().zip(follow) {
                *slow += follow * (effective - *slow);
            }
            let crept = creep * 0.5 * slow.iter().sum::<f64>();
            largest = largest.max(u);
            let target = gain * (effective + crept) + remanence * (largest / STROKE_V) + drift * row as f64 * INTERVAL_S;
            // Exact for an input that is constant since the row before.
            if row >= from {
                let centred = lagged - 23.0;
                out.push(zero + lagged + centred * centred * (sensor_1 + sensor_2 * centred));
            }
            lagged += (1.0 - (-INTERVAL_S / lag_s).exp()) * (target - lagged);
        }
        if out.iter().all(|y| y.is_finite()) { Ok(out) } else { Err("it ran away".into()) }
    }
}

/// Diagnoses both sessions.
///
/// # Errors
/// If the data cannot be read or the model cannot be simulated.
pub fn diagnosed(folder: &Path) -> Result<Outcome, Box<dyn Error>> {
    let plant = Stack::read(folder)?;
    let roles: Vec<Role> = STRETCHES.iter().map(|stretch| stretch.4).collect();
    Ok(found(&plant, "piezo stack", &roles)?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let Some(folder) = folder("piezo-stack") else { return Ok(()) };
    print(&diagnosed(&folder)?, "µm")
}
