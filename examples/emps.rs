//! The diagnosis on measurements: the Electro-Mechanical Positioning System (EMPS), a motor that moves a carriage along a ball screw.
//!
//! ```text
//! F(t) = M a + F_v v + F_0        nominal: M = 95 kg, F_v = 411 N·s/m, F_0 = −3 N
//! ```
//!
//! The nominal constants are those of a linear fit without any other friction. Inverse dynamics: the force that the motor was told to exert, 35.15 N/V times the controller's output, against the one that the motion needs.
//! Velocity v and acceleration a are central differences of the encoder's position after a zero-phase Butterworth filter of order 4 at 100 Hz; both
//! forces are filtered alike at 40 Hz and taken every 5 ms (the authors' parallel decimation). A run is a stroke of 3.12 s, forward or backward. σ is
//! what does not repeat from one cycle of 6.24 s to the next.
//!
//! A. Janot, M. Gautier, M. Brunot, "Data set and reference models of EMPS", Workshop on Nonlinear System Identification Benchmarks 2019.
//!
//! ```sh
//! cargo run --release --example emps -- ../shared/real    # the folder that holds emps/fit.npz and emps/pulses.npz
//! ```

#[path = "measured/common.rs"]
mod common;

#[path = "measured/filter.rs"]
mod filter;

use std::error::Error;
use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::path::Path;

use common::{at, candidate, column, constant, folder, found, free, one, print, residuals, rms, shape};
use filter::{central_differences, low_pass};
use sfers::diagnose::DiagnoseError;
use sfers::diagnose::dataset::Role;
use sfers::diagnose::pipeline::Outcome;
use sfers::diagnose::plant::{Candidate, Model, Nuisance, Plant, Signal, Term};

/// Mass (kg), viscous friction (N·s/m) and offset (N).
const NOMINAL: [f64; 3] = [95.0, 411.0, -3.0];
const NEWTONS_PER_VOLT: f64 = 35.15065;
/// Interval of the raw rows (s), and rows of a cycle, forward and backward.
const INTERVAL_S: f64 = 1e-3;
const CYCLE: usize = 6240;
/// Raw rows at the first reversal, and of a stroke.
const FIRST_REVERSAL: usize = 3104;
const STROKE: usize = 3120;
/// Every fifth row counts.
const EVERY: usize = 5;
/// Raw rows beside a run that its prediction is filtered with, and those without meaning at both ends of the record.
const MARGIN: usize = 300;
const ENDS: usize = 100;
const KINEMATICS_HZ: f64 = 100.0;
const FORCE_HZ: f64 = 40.0;

/// A record of the machine.
pub struct Emps {
    signals: Vec<Signal>,
    candidates: Vec<Candidate>,
    position_m: Vec<f64>,
    velocity_m_s: Vec<f64>,
    acceleration_m_s2: Vec<f64>,
    /// Raw rows (first, end) of each run.
    rows: Vec<(usize, usize)>,
}

fn candidates() -> Vec<Candidate> {
    let part = |name| free(name, "N", 0.0, [-20.0, 20.0], 1.0);
    let pitches: [&[f64]; 4] = [&[1.0, 1.0, 5.0], &[1.0, 1.0, 10.0], &[1.0, 1.0, 20.0], &[1.0, 1.0, 40.0]];
    let constants = vec![
        constant("mass", "The moved mass differs.", free("mass", "kg", NOMINAL[0], [20.0, 300.0], 5.0)),
        constant("viscous-friction", "Viscous friction differs.", free("coefficient", "N·s/m", NOMINAL[1], [0.0, 1000.0], 20.0)),
        // A Coulomb friction that differs by direction is a symmetric one and an offset.
        constant("offset", "The force has another offset.", free("force", "N", NOMINAL[2], [-50.0, 50.0], 1.0)),
    ];
    [
        constants,
        at(
            "force-of-speed",
            [
                one("coulomb-friction", "Coulomb friction.", "force", "N", [0.0, 100.0], 5.0),
                one(
                    "viscous-friction-by-direction",
                    "Viscous friction differs by direction.",
                    "forward_less_backward",
                    "N·s/m",
                    [-400.0, 400.0],
                    20.0,
                ),
                candidate(
                    "stribeck-friction",
                    "Coulomb friction changes at low speed (Stribeck).",
                    vec![free("force", "N", 0.0, [-60.0, 60.0], 2.0), shape("speed", "m/s", [1e-3, 0.1], 5e-3)],
                    &[&[2.0, 5e-3], &[2.0, 0.02]],
                ),
                one(
                    "quadratic-drag",
                    "Drag grows with the square of the speed.",
                    "coefficient",
                    "N·s²/m²",
                    [-3000.0, 3000.0],
                    100.0,
                ),
            ],
        ),
        at(
            "memory-of-friction",
            [one("presliding", "Friction grows over a distance after a reversal (Dahl).", "distance", "mm", [0.0, 2.0], 0.02)],
        ),
        at(
            "force-of-position",
            [
                one("spring", "The force depends on position.", "stiffness", "N/m", [-300.0, 300.0], 5.0),
                one("wear", "Viscous friction depends on position.", "slope", "N·s/m²", [-3000.0, 3000.0], 50.0),
                candidate(
                    "ripple",
                    "The force repeats with the turns of the screw or of the motor (cogging).",
                    vec![part("cosine"), part("sine"), shape("pitch", "mm", [2.0, 60.0], 0.1)],
                    &pitches,
                ),
            ],
        ),
        at("command", [one("delay", "The force follows its command late.", "time", "ms", [-10.0, 10.0], 0.5)]),
    ]
    .concat()
}

impl Emps {
    /// Reads a record and divides it into strokes.
    ///
    /// # Errors
    /// If the file is not such a record.
    pub fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let position_m = low_pass(&column(path, "q_m")?, KINEMATICS_HZ * INTERVAL_S);
        let volts = column(path, "v_v")?;
        let force_n = low_pass(&volts.iter().map(|v| NEWTONS_PER_VOLT * v).collect::<Vec<_>>(), FORCE_HZ * INTERVAL_S);
        let velocity_m_s = central_differences(&position_m, INTERVAL_S);
        let last = force_n.len();
        let repeats: Vec<f64> = (ENDS..last - CYCLE - ENDS).map(|i| (force_n[i + CYCLE] - force_n[i]) * FRAC_1_SQRT_2).collect();
        let ends = (0..).map(|k| FIRST_REVERSAL + k * STROKE).take_while(|end| *end < last - STROKE / 2);
        let ends: Vec<usize> = std::iter::once(ENDS).chain(ends).chain([last - ENDS]).collect();
        let rows: Vec<(usize, usize)> = ends.windows(2).map(|pair| (pair[0], pair[1])).collect();
        let of = |(k, (from, to)): (usize, &(usize, usize))| {
            let pick = |values: &[f64]| -> Vec<f64> { values[*from..*to].iter().step_by(EVERY).copied().collect() };
            let values = pick(&force_n);
            Signal {
                id: format!("stroke {}, {}", k + 1, if k % 2 == 0 { "forward" } else { "backward" }),
                sigmas: vec![rms(&repeats); values.len()],
                times: (0..values.len()).map(|i| (i * EVERY) as f64 * INTERVAL_S).collect(),
                channels: vec![0; values.len()],
                inputs: pick(&velocity_m_s),
                values,
                ..Signal::default()
            }
        };
        let signals = rows.iter().enumerate().map(of).collect();
        let acceleration_m_s2 = central_differences(&velocity_m_s, INTERVAL_S);
        Ok(Self { signals, candidates: candidates(), position_m, velocity_m_s, acceleration_m_s2, rows })
    }

    /// Root mean square of the residuals over that of the measured force, of all runs (–).
    ///
    /// # Errors
    /// If the model cannot be simulated.
    pub fn relative_error(&self, model: &Model) -> Result<f64, DiagnoseError> {
        let (rest, measured) = residuals(self, model, &(0..self.rows.len()).collect::<Vec<_>>())?;
        Ok(rms(&rest) / rms(&measured))
    }
}

/// The authors' model with symmetric Coulomb friction, and the one with viscous friction by direction.
fn published(candidates: &[Candidate]) -> [Model; 2] {
    let model = |values: &[(&str, f64)]| {
        let term = |(id, x): &(&str, f64)| Some(Term { candidate: candidates.iter().position(|c| c.id == *id)?, x: vec![*x] });
        Model::new(values.iter().filter_map(term).collect(), 1.0, true)
    };
    // The second one's Coulomb friction of 20.14 and 20.63 N is a symmetric one and an offset.
    let symmetric = [("mass", 95.11), ("viscous-friction", 203.5), ("coulomb-friction", 20.39), ("offset", -3.16)];
    let [forward, backward] = [166.7, 240.4];
    let viscous = [("viscous-friction", 0.5 * (forward + backward)), ("viscous-friction-by-direction", forward - backward)];
    let coulomb = [("mass", 95.11), ("coulomb-friction", 0.5 * (20.14 + 20.63)), ("offset", 0.5 * (20.14 - 20.63))];
    [model(&symmetric), model(&[viscous.as_slice(), &coulomb].concat())]
}

impl Plant for Emps {
    fn signals(&self) -> &[Signal] {
        &self.signals
    }

    fn channels(&self) -> Vec<String> {
        vec!["force".into()]
    }

    fn unit(&self) -> &'static str {
        "N"
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    /// One machine and one set-up: nothing differs from stroke to stroke.
    fn bench(&self) -> [Option<f64>; 6] {
        [Some(0.0); 6]
    }

    fn predict(&self, model: &Model, run: usize, _nuisance: &Nuisance) -> Result<Vec<f64>, DiagnoseError> {
        let value = |id: &str, name: &str| common::value(&self.candidates, model, id, name);
        let effect = |id: &str, name: &str| value(id, name).unwrap_or(0.0);
        let mass = value("mass", "mass").unwrap_or(NOMINAL[0]);
        let viscous = value("viscous-friction", "coefficient").unwrap_or(NOMINAL[1]);
        let offset = value("offset", "force").unwrap_or(NOMINAL[2]);
        let (coulomb, presliding_m) = (effect("coulomb-friction", "force"), 1e-3 * effect("presliding", "distance"));
        let by_direction = effect("viscous-friction-by-direction", "forward_less_backward");
        let (stribeck, speed_m_s) = (effect("stribeck-friction", "force"), value("stribeck-friction", "speed").unwrap_or(0.01));
        let (drag, spring, wear) =
            (effect("quadratic-drag", "coefficient"), effect("spring", "stiffness"), effect("wear", "slope"));
        let (cosine, sine) = (effect("ripple", "cosine"), effect("ripple", "sine"));
        let pitch_m = 1e-3 * value("ripple", "pitch").unwrap_or(5.0);
        let late_rows = 1e-3 * effect("delay", "time") / INTERVAL_S;

        let (from, to) = self.rows[run];
        let first = from.saturating_sub(MARGIN);
        let mut friction_state: Option<f64> = None;
        let force = |row: usize| {
            // The motion at which a command arrives.
            let at = (row as f64 + late_rows).clamp(0.0, (self.position_m.len() - 2) as f64);
            let (low, share) = (at as usize, at.fract());
            let [q, v, a] = [&self.position_m, &self.velocity_m_s, &self.acceleration_m_s2]
                .map(|values| values[low] + share * (values[low + 1] - values[low]));
            // The mean of the sign over a row: velocity is linear in it.
            let mut sign = (2.0 * v / (a.abs() * INTERVAL_S).max(1e-6)).clamp(-1.0, 1.0);
            if presliding_m > 0.0 {
                let before = friction_state.unwrap_or(sign);
                // Exact for a velocity that is constant in the row.
                sign = v.signum() + (before - v.signum()) * (-v.abs() * INTERVAL_S / presliding_m).exp();
                friction_state = Some(sign);
            }
            let centred = q - 0.12;
            mass * a
                + (viscous + wear * centred) * v
                + offset
                + sign * (coulomb + stribeck * (-v.abs() / speed_m_s).exp())
                + 0.5 * by_direction * v.abs()
                + drag * v * v.abs()
                + spring * centred
                + cosine * (2.0 * PI * q / pitch_m).cos()
                + sine * (2.0 * PI * q / pitch_m).sin()
        };
        let forces: Vec<f64> = (first..(to + MARGIN).min(self.position_m.len())).map(force).collect();
        Ok(low_pass(&forces, FORCE_HZ * INTERVAL_S)[from - first..to - first].iter().step_by(EVERY).copied().collect())
    }
}

/// The diagnosis with its relative force error on the record itself and on the one with pulses, which served neither fit nor selection.
pub struct Found {
    /// The whole diagnosis.
    pub outcome: Outcome,
    /// On all strokes of the record (–).
    pub error: f64,
    /// On all strokes of the record with pulses (–).
    pub error_with_pulses: f64,
    /// Of the two published models on both records (–).
    pub published: [[f64; 2]; 2],
}

/// Diagnoses `fit.npz`: six strokes to fit, the fifth and sixth to judge.
///
/// # Errors
/// If the data cannot be read or the model cannot be simulated.
pub fn diagnosed(folder: &Path) -> Result<Found, Box<dyn Error>> {
    let emps = Emps::read(&folder.join("fit.npz"))?;
    let roles: Vec<Role> = (0..emps.rows.len()).map(|k| if k == 4 || k == 5 { Role::HeldOut } else { Role::Fit }).collect();
    let outcome = found(&emps, "EMPS", &roles)?;
    let model = outcome.extended.model();
    let pulses = Emps::read(&folder.join("pulses.npz"))?;
    let errors = |model: &Model| Ok::<_, DiagnoseError>([emps.relative_error(model)?, pulses.relative_error(model)?]);
    let [error, error_with_pulses] = errors(model)?;
    let [symmetric, by_direction] = published(&emps.candidates);
    let published = [errors(&symmetric)?, errors(&by_direction)?];
    Ok(Found { error, error_with_pulses, published, outcome })
}

fn main() -> Result<(), Box<dyn Error>> {
    let Some(folder) = folder("emps") else { return Ok(()) };
    let found = diagnosed(&folder)?;
    print(&found.outcome, "N")?;
    println!("relative force error {:.2} %, with pulses {:.2} %", 100.0 * found.error, 100.0 * found.error_with_pulses);
    for (name, [error, pulses]) in ["symmetric friction", "friction by direction"].iter().zip(found.published) {
        println!("with the published constants, {name}: {:.2} %, with pulses {:.2} %", 100.0 * error, 100.0 * pulses);
    }
    Ok(())
}
