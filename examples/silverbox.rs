//! The diagnosis on measurements: the Silverbox, an electronic circuit that behaves like a mass on a spring and a damper.
//!
//! ```text
//! x'' + 2 ζ ω x' + ω² x = g ω² u(t),   y = x + y₀        nominal: ω = 2π·68 /s, ζ = 0.05, g = 1, y₀ = 0
//! ```
//!
//! Input u and output y are voltages, 610.35 rows a second. A run is one of the ten random-phase odd multisines; the model starts 400 rows before a
//! run, at rest, and needs no measured output for its state. The input between rows is band-limited (windowed sinc), the step is a quarter of a row by
//! Runge and Kutta's rule. Five runs are fitted and two select; the last quarter of the multisines and the Gaussian arrow serve neither.
//!
//! σ = 0.2 mV is what the output holds at even multiples of the base frequency, 610.35/8192 Hz, where an odd multisine excites nothing: noise and even
//! distortions together, of 5 to 195 Hz.
//!
//! T. Wigren, J. Schoukens, "Three free data sets for development and benchmarking in nonlinear system identification", ECC 2013, 2933.
//!
//! ```sh
//! cargo run --release --example silverbox -- ../shared/real    # the folder that holds silverbox/silverbox.npz
//! ```

#[path = "measured/common.rs"]
mod common;

use std::error::Error;
use std::f64::consts::PI;
use std::path::Path;

use common::{at, candidate, column, constant, folder, found, free, one, print, residuals, rms, shape};
use sfers::diagnose::DiagnoseError;
use sfers::diagnose::dataset::Role;
use sfers::diagnose::pipeline::Outcome;
use sfers::diagnose::plant::{Candidate, Model, Nuisance, Plant, Signal};

const INTERVAL_S: f64 = 16_384.0 / 1e7;
const SIGMA_MV: f64 = 0.2;
/// Rows of the multisines, of the stretch to judge and of the arrow.
const MULTISINES: [usize; 2] = [40_650, 127_400];
const JUDGED: [usize; 2] = [105_713, 127_400];
const ARROW: [usize; 2] = [100, 40_575];
/// Rows of the arrow that need no extrapolation.
const ARROW_INSIDE: [usize; 2] = [100, 32_100];
/// Rows of one multisine, and runs that are fitted or select: all that end before the judged stretch.
const REALISATION: usize = 8_691;
const RUNS: usize = 7;
/// Rows that the model runs before a run; at the decay rate ζω its state at rest is forgotten after 50.
const WARM_UP: usize = 400;
/// First rows of a judged stretch that do not count.
const START: usize = 50;
/// Input values per row, for Runge and Kutta's rule at an eighth of a row; the search takes every second.
const PARTS: usize = 16;

/// The circuit's record.
pub struct Silverbox {
    signals: Vec<Signal>,
    candidates: Vec<Candidate>,
    /// Input (V), [`PARTS`] values a row.
    input_v: Vec<f64>,
    /// Rows (first, end) of each run.
    rows: Vec<[usize; 2]>,
}

/// The band-limited input between rows, by a sinc of 24 rows with a Hann window.
fn between_rows(input: &[f64]) -> Vec<f64> {
    const HALF: isize = 12;
    let kernel = |distance: f64| {
        let window = 0.5 * (1.0 + (PI * distance / HALF as f64).cos());
        if distance == 0.0 { 1.0 } else { window * (PI * distance).sin() / (PI * distance) }
    };
    let kernels: Vec<Vec<f64>> =
        (0..PARTS).map(|part| (1 - HALF..=HALF).map(|k| kernel(part as f64 / PARTS as f64 - k as f64)).collect()).collect();
    let last = input.len().cast_signed() - 1;
    let at = |row: usize, kernel: &[f64]| -> f64 {
        let first = row.cast_signed() + 1 - HALF;
        kernel.iter().zip(first..).map(|(weight, k)| weight * input[k.clamp(0, last).cast_unsigned()]).sum()
    };
    (0..input.len()).flat_map(|row| kernels.iter().map(move |kernel| at(row, kernel))).collect()
}

fn candidates() -> Vec<Candidate> {
    let coefficient = |id, cause, unit, bound: f64, scale| one(id, cause, "coefficient", unit, [-bound, bound], scale);
    let constants = vec![
        constant("gain", "The output is scaled.", free("gain", "", 1.0, [0.5, 2.0], 0.02)),
        constant("frequency", "The circuit is faster or slower.", free("frequency", "Hz", 68.0, [40.0, 100.0], 1.0)),
        constant("damping-ratio", "The damping ratio differs.", free("ratio", "", 0.05, [0.005, 0.5], 0.005)),
        constant("offset", "The output has an offset.", free("output", "mV", 0.0, [-50.0, 50.0], 1.0)),
    ];
    [
        constants,
        at(
            "spring",
            [
                coefficient("cubic-spring", "The spring hardens on both sides.", "1/V²", 50.0, 0.3),
                coefficient("quadratic-spring", "The spring hardens on one side.", "1/V", 5.0, 0.05),
                coefficient("fifth-order-spring", "The spring hardens at the largest deflections.", "1/V⁴", 500.0, 3.0),
            ],
        ),
        at(
            "damper",
            [
                coefficient("quadratic-damping", "Damping grows with the speed.", "1/V", 10.0, 0.05),
                coefficient("cubic-damping", "Damping grows with the square of the deflection.", "1/V²", 200.0, 1.0),
                one("dry-friction", "Friction of constant size opposes motion.", "force", "mV", [0.0, 50.0], 0.2),
            ],
        ),
        at("input", [coefficient("input-saturation", "Large inputs are compressed (u − c u³).", "1/V²", 20.0, 0.3)]),
        at(
            "output",
            [
                coefficient("output-saturation", "Large outputs are compressed (y − c y³).", "1/V²", 10.0, 0.1),
                coefficient("output-curvature", "The output's gain differs by side (y + c y²).", "1/V", 5.0, 0.03),
            ],
        ),
        at(
            "memory",
            [
                one("delay", "The output follows late.", "time", "ms", [-4.0, 4.0], 0.05),
                candidate(
                    "creep",
                    "A part of the output follows by a lag.",
                    vec![free("share", "", 0.0, [-0.5, 0.5], 0.01), shape("time", "s", [0.005, 5.0], 0.05)],
                    &[&[0.02, 0.02], &[0.02, 0.3]],
                ),
            ],
        ),
    ]
    .concat()
}

impl Silverbox {
    /// Reads the record, with the runs that are fitted or select.
    ///
    /// # Errors
    /// If the file is not such a record.
    pub fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let rows = (0..RUNS).map(|k| MULTISINES[0] + k * REALISATION).map(|first| [first, first + REALISATION]);
        Self::with_runs(path, rows.collect())
    }

    fn with_runs(path: &Path, rows: Vec<[usize; 2]>) -> Result<Self, Box<dyn Error>> {
        let (input, output) = (column(path, "input_v")?, column(path, "output_v")?);
        let of = |(k, &[from, to]): (usize, &[usize; 2])| Signal {
            id: format!("multisine {}", k + 1),
            values: output[from..to].iter().map(|y| 1e3 * y).collect(),
            sigmas: vec![SIGMA_MV; to - from],
            times: (0..to - from).map(|row| row as f64 * INTERVAL_S).collect(),
            channels: vec![0; to - from],
            inputs: input[from..to].to_vec(),
            ..Signal::default()
        };
        let signals = rows.iter().enumerate().map(of).collect();
        Ok(Self { signals, candidates: candidates(), input_v: between_rows(&input), rows })
    }
}

impl Plant for Silverbox {
    fn signals(&self) -> &[Signal] {
        &self.signals
    }

    fn channels(&self) -> Vec<String> {
        vec!["output".into()]
    }

    fn unit(&self) -> &'static str {
        "mV"
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    /// One record: nothing differs from run to run.
    fn bench(&self) -> [Option<f64>; 6] {
        [Some(0.0); 6]
    }

    fn predict(&self, model: &Model, run: usize, _nuisance: &Nuisance) -> Result<Vec<f64>, DiagnoseError> {
        let value = |id: &str, name: &str| common::value(&self.candidates, model, id, name);
        let effect = |id: &str| value(id, "coefficient").unwrap_or(0.0);
        let omega = 2.0 * PI * value("frequency", "frequency").unwrap_or(68.0);
        let (gain, zeta) = (value("gain", "gain").unwrap_or(1.0), value("damping-ratio", "ratio").unwrap_or(0.05));
        let (quadratic, cubic, fifth) = (effect("quadratic-spring"), effect("cubic-spring"), effect("fifth-order-spring"));
        let (drag, thick) = (effect("quadratic-damping"), effect("cubic-damping"));
        let (compressed, output_3, output_2) =
            (effect("input-saturation"), effect("output-saturation"), effect("output-curvature"));
        let dry_v = 1e-3 * value("dry-friction", "force").unwrap_or(0.0);
        let late_rows = 1e-3 * value("delay", "time").unwrap_or(0.0) / INTERVAL_S;
        let (creep, creep_s) = (value("creep", "share").unwrap_or(0.0), value("creep", "time").unwrap_or(0.1));
        let offset_mv = value("offset", "output").unwrap_or(0.0);

        // Time in 1/ω, so that x and dx/dt are both in V.
        let acceleration = |x: f64, v: f64, u: f64| {
            let friction = if dry_v > 0.0 { dry_v * (v / 1e-3).tanh() } else { 0.0 };
            gain * (u - compressed * u * u * u)
                - x * (1.0 + x * (quadratic + x * (cubic + x * x * fifth)))
                - v * (2.0 * zeta + drag * v.abs() + thick * x * x)
                - friction
        };
        let steps = if model.fine { PARTS / 2 } else { PARTS / 4 };
        let (stride, h) = (PARTS / steps, omega * INTERVAL_S / steps as f64);
        let [from, to] = self.rows[run];
        let first = from.saturating_sub(WARM_UP);
        let (mut x, mut v, mut slow) = (0.0_f64, 0.0_f64, 0.0_f64);
        let follow = 1.0 - (-INTERVAL_S / creep_s).exp();
        let mut out = Vec::with_capacity(to - from);
        for row in first..to {
            if row >= from {
                // At a row less the delay, by Taylor's rule.
                let t = -late_rows * h * steps as f64;
                let late = x + t * v + 0.5 * t * t * acceleration(x, v, self.input_v[row * PARTS]);
                let y = late + creep * (slow - late);
                out.push(1e3 * (y + y * y * (output_2 - output_3 * y)) + offset_mv);
            }
            slow += follow * (x - slow);
            for step in 0..steps {
                let at = row * PARTS + step * stride;
                let end = (at + stride).min(self.input_v.len() - 1);
                let [u0, u1, u2] = [at, at + stride / 2, end].map(|k| self.input_v[k]);
                let a1 = acceleration(x, v, u0);
                let (x2, v2) = (x + 0.5 * h * v, v + 0.5 * h * a1);
                let a2 = acceleration(x2, v2, u1);
                let (x3, v3) = (x + 0.5 * h * v2, v + 0.5 * h * a2);
                let a3 = acceleration(x3, v3, u1);
                let (x4, v4) = (x + h * v3, v + h * a3);
                let a4 = acceleration(x4, v4, u2);
                x += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4);
                v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
            }
        }
        if out.iter().all(|y| y.is_finite()) { Ok(out) } else { Err("it ran away".into()) }
    }
}

/// The diagnosis with its errors on stretches that served neither fit nor selection (mV rms).
pub struct Found {
    /// The whole diagnosis.
    pub outcome: Outcome,
    /// Last quarter of the multisines, whole arrow, arrow without extrapolation.
    pub errors_mv: [f64; 3],
    /// The same of the linear model with re-tuned constants.
    pub linear_errors_mv: [f64; 3],
}

/// Diagnoses `silverbox.npz`.
///
/// # Errors
/// If the data cannot be read or the model cannot be simulated.
pub fn diagnosed(folder: &Path) -> Result<Found, Box<dyn Error>> {
    let plant = Silverbox::read(&folder.join("silverbox.npz"))?;
    let roles: Vec<Role> = (0..RUNS).map(|k| if k == 2 || k == 5 { Role::HeldOut } else { Role::Fit }).collect();
    let outcome = found(&plant, "Silverbox", &roles)?;
    let (errors_mv, linear_errors_mv) = (errors(folder, outcome.extended.model())?, errors(folder, outcome.calibrated.model())?);
    Ok(Found { errors_mv, linear_errors_mv, outcome })
}

/// Errors (mV rms) of a model on the last quarter of the multisines, on the arrow, and on what of the arrow needs no extrapolation.
///
/// # Errors
/// If the data cannot be read or the model cannot be simulated.
pub fn errors(folder: &Path, model: &Model) -> Result<[f64; 3], Box<dyn Error>> {
    let judged = Silverbox::with_runs(&folder.join("silverbox.npz"), vec![JUDGED, ARROW, ARROW_INSIDE])?;
    let mut all = [0.0; 3];
    for (run, error) in all.iter_mut().enumerate() {
        *error = rms(&residuals(&judged, &Model { fine: true, ..model.clone() }, &[run])?.0[START..]);
    }
    Ok(all)
}

fn main() -> Result<(), Box<dyn Error>> {
    let Some(folder) = folder("silverbox") else { return Ok(()) };
    let found = diagnosed(&folder)?;
    print(&found.outcome, "mV")?;
    for (name, [multisine, arrow, inside]) in [("extended", found.errors_mv), ("linear", found.linear_errors_mv)] {
        println!(
            "{name}: last quarter of the multisines {multisine:.3} mV, arrow {arrow:.3} mV, its first 32,000 rows {inside:.3} mV"
        );
    }
    Ok(())
}
