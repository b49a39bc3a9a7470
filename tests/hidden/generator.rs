//! Measured data of a bench that was never built: a clamped piezoelectric sheet in which one effect, or a few, are hidden.
//!
//! Nothing here comes from the program that is to find the effect. The chain has twelve joints instead of the few of the program,
//! its coordinates are absolute angles with a dense mass matrix instead of joint angles and a recursion, its integrator is an
//! L-stable third-order Runge-Kutta method, and it has its own random numbers. Several effects follow other equations than those
//! the program fits: hysteresis is a sum of play operators (with the gain kept
//! over a full stroke), creep and structural damping have branches half a decade apart, dry
//! friction follows an arc tangent, drag is a quadrature along each rod, a saturating amplifier has a rounded knee, and the gain
//! that grows with the field is smooth at zero. What they share is the physics: a wrong sign or factor shows as a misfit.
//!
//! `OUTSIDE` are effects whose equations no entry of the program's library has; some have a namesake there. forms.rs has five other equations for each of twelve of the effects, bench.rs
//! faults of a bench that come on top of anything, cases.rs the ids of all that can be hidden.

#![allow(dead_code)] // every test uses a part of it

#[path = "bench.rs"]
pub mod bench;
#[path = "cases.rs"]
pub mod cases;
#[path = "chain.rs"]
pub mod chain;
#[path = "curves.rs"]
pub mod curves;
#[path = "effects.rs"]
pub mod effects;
#[path = "filters.rs"]
pub mod filters;
#[path = "forms.rs"]
pub mod forms;
#[path = "memories.rs"]
pub mod memories;
#[path = "moments.rs"]
pub mod moments;
#[path = "protocol.rs"]
pub mod protocol;
#[path = "../common/random.rs"]
pub mod random;

use bench::{Bench, Faults};
use chain::{Chain, Grid};
use effects::{Nature, hide};
use protocol::{Drive, RUNS, Run};
use random::Random;
use std::fmt::Write;
use std::path::Path;
use std::sync::OnceLock;

/// An effect that was hidden, with the truth in the units of the library.
pub struct Hidden {
    pub id: &'static str,
    pub parameters: Vec<(&'static str, f64)>,
}

/// What a dataset holds: the effects, the rms of what they change in the noise-free markers, and the length of the runs.
pub struct Truth {
    pub hidden: Vec<Hidden>,
    pub trace_mm: f64,
    pub motion_s: f64,
}

/// What to generate.
#[derive(Clone)]
pub struct Case<'a> {
    pub effects: &'a [&'a str],
    /// Small, medium or large: 0, 1, 2.
    pub size: usize,
    pub noise_mm: f64,
    pub seed: u64,
    pub outliers: bool,
    pub damaged: bool,
    /// `motors_per_actuator` written to dataset.toml.
    pub m: usize,
}

/// Effects of the library.
pub const INSIDE: &[&str] = &[
    "stiffness",
    "actuation-gain",
    "damping",
    "areal-mass",
    "clamp-compliance",
    "tip-mass",
    "initial-curvature",
    "stiffness-softening",
    "dry-friction",
    "structural-damping",
    "air-drag",
    "hysteresis",
    "creep",
    "field-dependent-gain",
    "polarity-asymmetry",
    "passive-margin",
    "driver-lag",
    "slew-limit",
    "time-delay",
    "saturation",
    "sensor-scale",
    "sensor-offset",
    "sensor-delay",
    "camera-tilt",
];

/// An effect that is a fault of the bench: a gain that differs from run to run.
pub const DRIFTING_GAIN: &str = "drifting-gain";

/// Effects that the library does not have with these equations.
pub const OUTSIDE: &[&str] = &["marker-slip", "cable-drag", "resonant-fixture", "mains-hum", "remanence"];

/// Arc lengths of the markers mid and tip, cm.
const ARCS: [f64; 2] = [5.0, 10.0];
const GRID: Grid = Grid { joints: 12, step: 2.5e-4 };

/// Friction and a cable turn sharply: they need half the step.
fn grid_for(nature: &Nature) -> Grid {
    let other = nature.other.joint.is_some_and(|law| law.is_sharp());
    let sharp = nature.friction_dyn_cm > 0.0 || nature.cable.is_some() || other;
    Grid { step: if sharp { 0.5 * GRID.step } else { GRID.step }, ..GRID }
}

/// Markers of a run without noise: mid x, mid z, tip x, tip z in mm.
pub type Markers = Vec<[f64; 4]>;

/// Writes dataset.toml and the CSV files of a case.
pub fn write(folder: &Path, case: &Case) -> Truth {
    write_on(folder, case, &Bench::default())
}

/// The same on a bench with faults, which do not count as trace.
pub fn write_on(folder: &Path, case: &Case, bench: &Bench) -> Truth {
    let mut nature = Nature::default();
    let chosen = case.effects.iter().filter(|id| **id != "none");
    let hidden: Vec<Hidden> = chosen.map(|id| hide_any(id, case, &mut nature)).collect();
    let clean = nominal();
    let grid = grid_for(&nature);
    let markers = if hidden.is_empty() { clean.clone() } else { simulate(&nature, grid) };
    let faults = Faults::draw(bench, case.seed);
    let films = if bench.films_anew() { films_on(&nature, grid, bench, &faults) } else { markers.clone() };
    std::fs::create_dir_all(folder).expect("the folder of the dataset");
    std::fs::write(folder.join("dataset.toml"), description(case, bench)).expect("dataset.toml");
    let mut random = Random::with_purpose(case.seed, "camera");
    let damaged = case.damaged.then(|| random.below(RUNS.len()));
    for (i, (run, mut seen)) in RUNS.iter().zip(films).enumerate() {
        let times = bench.times(run);
        faults[i].shift(&mut seen, &times);
        if bench.correlation_s > 0.0 {
            bench::add_correlated_noise(&mut seen, &times, case, bench.correlation_s, &mut random);
        } else {
            photograph(&mut seen, case, &mut random);
        }
        if damaged == Some(i) {
            let half = seen.len() / 2;
            let (before, after) = seen.split_at_mut(half);
            after.iter_mut().for_each(|row| row[2..].copy_from_slice(&before[half - 1][2..]));
        }
        let text = table(run, &times, bench, &seen);
        std::fs::write(folder.join(format!("{}.csv", run.id)), text).expect("the CSV of a run");
    }
    Truth { hidden, trace_mm: trace(&markers, clean), motion_s: RUNS.iter().map(|run| run.duration).sum() }
}

/// Hides an effect or another form of one.
fn hide_any(id: &str, case: &Case, nature: &mut Nature) -> Hidden {
    if let Some(form) = forms::find(id) {
        return forms::hide(form, case.size, case.seed, nature);
    }
    let known = INSIDE
        .iter()
        .chain(OUTSIDE)
        .chain([&DRIFTING_GAIN])
        .find(|known| **known == id)
        .unwrap_or_else(|| panic!("no effect {id}"));
    hide(known, case.size, case.seed, nature)
}

/// The markers of every run as a bench with faults of clock, gain and frames films them. Runs go on a little for a clock that is ahead.
fn films_on(nature: &Nature, grid: Grid, bench: &Bench, faults: &[Faults]) -> Vec<Markers> {
    const MORE_S: f64 = 0.05;
    let film = |(index, run): (usize, &Run)| {
        let mut nature = nature.clone();
        nature.run_gains[index] *= faults[index].gain;
        let longer = Run { id: run.id, interval: run.interval, duration: run.duration + MORE_S, wave: run.wave };
        film_at(&nature, grid, index, &longer, &bench.times(run), faults[index].clock_s.clamp(-MORE_S, MORE_S))
    };
    RUNS.iter().enumerate().map(film).collect()
}

/// The markers when nothing is hidden.
pub fn nominal() -> &'static Vec<Markers> {
    static NOMINAL: OnceLock<Vec<Markers>> = OnceLock::new();
    NOMINAL.get_or_init(|| simulate(&Nature::default(), GRID))
}

/// The markers of every run, without noise.
pub fn simulate(nature: &Nature, grid: Grid) -> Vec<Markers> {
    RUNS.iter().enumerate().map(|(index, run)| film(nature, grid, index, run)).collect()
}

/// Root mean square of the difference of all markers.
pub fn trace(a: &[Markers], b: &[Markers]) -> f64 {
    let pairs = a.iter().flatten().flatten().zip(b.iter().flatten().flatten());
    let (sum, count) = pairs.fold((0.0, 0), |(sum, count), (x, y)| (sum + (x - y) * (x - y), count + 1));
    (sum / f64::from(count)).sqrt()
}

/// One run as the camera would see it without noise.
fn film(nature: &Nature, grid: Grid, index: usize, run: &Run) -> Markers {
    film_at(nature, grid, index, run, &run.times(), 0.0)
}

/// The same at given times of a clock that is late.
fn film_at(nature: &Nature, grid: Grid, index: usize, run: &Run, times: &[f64], late_s: f64) -> Markers {
    let drive = Drive::of(run, nature, nature.run_gains[index]);
    let moments: Vec<f64> = times.iter().map(|t| t - nature.sensor_delay_s - late_s).collect();
    let chain = Chain::new(nature, grid);
    let mut film = Vec::with_capacity(times.len());
    match nature.slips[index] {
        None => chain.run(&drive, &moments, ARCS, |row| film.push(row)),
        Some((when, length)) => {
            chain.run(&drive, &moments, ARCS, |row| film.push(row));
            let mut slipped = Vec::with_capacity(times.len());
            chain.run(&drive, &moments, [ARCS[0], ARCS[1] - 0.1 * length], |row| slipped.push(row));
            let after = times.iter().take_while(|t| **t < when).count();
            film[after..].copy_from_slice(&slipped[after..]);
        }
    }
    film.iter_mut().zip(times).for_each(|(row, t)| distort(row, nature, index, *t));
    film
}

/// What the camera does to a row: hum, tilt, scale and offset.
fn distort(row: &mut [f64; 4], nature: &Nature, index: usize, t: f64) {
    let (sine, cosine) = nature.tilt_rad.sin_cos();
    let hum = nature
        .hum
        .as_ref()
        .map_or(0.0, |hum| hum.amplitude_mm * (std::f64::consts::TAU * hum.hertz * t + hum.phases[index]).sin());
    for marker in row.chunks_exact_mut(2) {
        let (x, z) = (marker[0] + 0.3 * hum, marker[1] + hum);
        marker[0] = nature.sensor_scale * (x * cosine - z * sine) + nature.offset_mm[0];
        marker[1] = nature.sensor_scale * (x * sine + z * cosine) + nature.offset_mm[1];
    }
}

/// Adds noise, and outliers where the case has them.
fn photograph(rows: &mut Markers, case: &Case, random: &mut Random) {
    for row in rows {
        for value in row.iter_mut() {
            *value += case.noise_mm * random.normal();
        }
        for marker in row.chunks_exact_mut(2) {
            if case.outliers && random.uniform() < 0.02 {
                marker[0] += random.between(-20.0, 20.0);
                marker[1] += random.between(-20.0, 20.0);
            }
        }
    }
}

fn table(run: &Run, times: &[f64], bench: &Bench, rows: &Markers) -> String {
    let (decimals, rows_per_frame) = (bench.decimals(), bench.rows_per_frame(run));
    let mut text = String::from("t_s,v1_v,mid_x_mm,mid_z_mm,tip_x_mm,tip_z_mm\n");
    for (i, (t, row)) in times.iter().zip(rows).enumerate() {
        let [a, b, c, d] = row;
        if i % rows_per_frame != 0 {
            let _ = writeln!(text, "{t:.decimals$},{:.2},,,,", run.wave.volts(*t));
            continue;
        }
        let _ = writeln!(text, "{t:.decimals$},{:.2},{a:.3},{b:.3},{c:.3},{d:.3}", run.wave.volts(*t));
    }
    text
}

fn description(case: &Case, bench: &Bench) -> String {
    let mut text = format!(
        "[dataset]\nname = \"case\"\nabout = \"single-actuator cantilever, tip and mid markers from a camera\"\n\n\
         [material]\npreset = \"parameter-2\"\n\n\
         [robot]\nactuators = 1\nmotors_per_actuator = {}\nmount = \"clamped\"\ndamping_eta = 0.008\n\n\
         [markers]           # distance from the clamped end along the robot, mm\nmid = 50.0\ntip = 100.0\n",
        case.m
    );
    if let Some(factor) = bench.stated_noise {
        let stated = factor * case.noise_mm;
        let _ = write!(text, "\n[noise]             # one standard deviation, mm\ndefault_mm = {stated}\n");
    }
    for run in &RUNS {
        let _ = write!(text, "\n[[run]]\nid = \"{0}\"\nfile = \"{0}.csv\"\n", run.id);
    }
    text
}
