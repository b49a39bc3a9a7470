//! Measured data of a robot on the floor, made by the Bullet engine: the candidates run on the planar one, with another contact and another
//! time stepping. What is hidden in the voltages and in the camera has equations of its own, here.
//!
//! Three actuators crawl over the floor in ten runs, by waves of different speed, height and direction. They move in a plane, as on a bench between
//! guides. Left to itself Bullet's robot does not: which of the corners side by side bears a foot is open, its solver takes those first in its list,
//! the feet stand across from one another, and friction turns the robot by a milliradian or two, which changes its strides by some
//! hundredths of a millimetre.

#![allow(dead_code)] // every test uses a part of it

use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;
use std::sync::OnceLock;

use rayon::prelude::*;
use sfers::engine::{BulletEngine, Engine};
use sfers::experiment::{self, Experiment, Source};
use sfers::model::Robot;

use super::generator::effects::{loop_width, put};
use super::generator::protocol::Plays;
use super::generator::random::Random;

/// Time between rows (s).
pub const ROW: f64 = 5e-3;
/// Bullet's steps per row, of 2e-5 s: half of what its explicit torque law stands.
pub const STEPS_PER_ROW: usize = 250;
/// The same where impacts return something. What a foot's load adds to its speed in a step is reflected as well if it is more than 0.2 cm/s (7000 dyn
/// on the 0.35 g of a corner: 0.4 cm/s in 2e-5 s): feet under load chatter, and the robot creeps by half a millimetre a second. At 5e-6 s that is gone.
const STEPS_PER_ROW_WITH_RESTITUTION: usize = 1000;
pub const ROWS: usize = 241;
/// Rows that the robot is left alone on the floor before a run.
pub const REST: usize = 80;
pub const ACTUATORS: usize = 3;
/// Markers along the robot (cm).
const MARKERS: [(&str, f64); 3] = [("left", 0.0), ("middle", 15.0), ("right", 30.0)];

/// Tables of the nominal robot.
pub const ROBOT: &str = r#"
[material]
preset = "parameter-2"

[robot]
actuators = 3
motors_per_actuator = 3
mount = "ground"
damping_eta = 0.045

[robot.friction]
low = 0.3
high = 0.9
film = "right-end"
"#;

/// A wave of voltages along the robot.
pub struct Wave {
    pub id: &'static str,
    pub hertz: f64,
    pub volts: f64,
    /// Phase from one actuator to the next, in turns.
    pub phase: f64,
}

const fn wave(id: &'static str, hertz: f64, volts: f64, phase: f64) -> Wave {
    Wave { id, hertz, volts, phase }
}

pub const WAVES: [Wave; 10] = [
    wave("forward-2hz", 2.0, -1200.0, 0.25),
    wave("forward-3hz", 3.0, -800.0, 0.25),
    wave("forward-4hz", 4.0, -1200.0, 0.25),
    wave("forward-6hz", 6.0, -700.0, 0.25),
    wave("backward-2hz", 2.0, -900.0, -0.25),
    wave("backward-3hz", 3.0, -1200.0, -0.25),
    wave("backward-5hz", 5.0, -1000.0, -0.25),
    wave("bound-2hz", 2.0, -1000.0, 0.0),
    wave("bound-4hz", 4.0, -600.0, 0.0),
    wave("ripple-3hz", 3.0, -1000.0, 0.4),
];

impl Wave {
    /// Voltage of an actuator (from 0); it swells from nothing within 0.3 s.
    pub fn volts(&self, t: f64, actuator: usize) -> f64 {
        let swell = (t / 0.3).clamp(0.0, 1.0);
        let swell = swell * swell * (3.0 - 2.0 * swell);
        swell * 0.5 * self.volts * (1.0 - (TAU * (self.hertz * t - self.phase * actuator as f64)).cos())
    }
}

/// What is hidden; the default is nothing.
#[derive(Clone)]
pub struct Floor {
    pub friction: f64,
    pub static_ratio: f64,
    pub restitution: f64,
    pub slope_deg: f64,
    /// Gain of every actuator.
    pub gains: [f64; ACTUATORS],
    pub delay_s: f64,
    pub hysteresis: f64,
    pub tilt_deg: f64,
    /// True if the robot is kept in its plane.
    pub in_plane: bool,
}

impl Default for Floor {
    fn default() -> Self {
        Self {
            friction: 1.0,
            static_ratio: 1.0,
            restitution: 0.0,
            slope_deg: 0.0,
            gains: [1.0; ACTUATORS],
            delay_s: 0.0,
            hysteresis: 0.0,
            tilt_deg: 0.0,
            in_plane: true,
        }
    }
}

/// An effect that can be hidden, with the ranges of a small, a medium and a large value, which may be mirrored at the value that hides nothing.
pub struct Sizes {
    pub id: &'static str,
    ranges: [(f64, f64); 3],
    mirror: Option<f64>,
}

const fn one(id: &'static str, ranges: [(f64, f64); 3]) -> Sizes {
    Sizes { id, ranges, mirror: None }
}

const fn two(id: &'static str, off: f64, ranges: [(f64, f64); 3]) -> Sizes {
    Sizes { id, ranges, mirror: Some(off) }
}

pub const INSIDE: [Sizes; 9] = [
    two("ground-friction", 1.0, [(0.88, 0.83), (0.78, 0.65), (0.6, 0.45)]),
    one("stick-slip", [(1.1, 1.15), (1.2, 1.3), (1.35, 1.5)]),
    one("contact-restitution", [(0.2, 0.3), (0.35, 0.45), (0.5, 0.6)]),
    two("ground-slope", 0.0, [(0.7, 0.9), (1.2, 1.8), (2.2, 2.9)]),
    one("weak-actuator", [(0.98, 0.97), (0.955, 0.93), (0.9, 0.8)]),
    two("actuation-gain", 1.0, [(0.985, 0.98), (0.97, 0.955), (0.94, 0.9)]),
    one("time-delay", [(0.004, 0.005), (0.006, 0.01), (0.012, 0.018)]),
    one("hysteresis", [(0.1, 0.15), (0.2, 0.3), (0.35, 0.45)]),
    two("camera-tilt", 0.0, [(0.13, 0.2), (0.3, 0.5), (0.7, 1.5)]),
];

/// Hides an effect, drawn by the seed, and says its parameters in the units of the library.
pub fn hide(id: &str, size: usize, seed: u64) -> (Floor, Vec<(&'static str, f64)>) {
    let Sizes { ranges, mirror, .. } =
        INSIDE.into_iter().find(|sizes| sizes.id == id).unwrap_or_else(|| panic!("no effect {id}"));
    let mut random = Random::with_purpose(seed, &format!("floor {id} {size}"));
    let drawn = random.between(ranges[size].0, ranges[size].1);
    let value = match mirror {
        Some(off) if random.uniform() < 0.5 => 2.0 * off - drawn,
        _ => drawn,
    };
    let mut floor = Floor::default();
    let name = match id {
        "ground-friction" => put(&mut floor.friction, value, "scale"),
        "stick-slip" => put(&mut floor.static_ratio, value, "static_ratio"),
        "contact-restitution" => put(&mut floor.restitution, value, "restitution"),
        "ground-slope" => put(&mut floor.slope_deg, value, "angle_deg"),
        "weak-actuator" => {
            let which = random.below(ACTUATORS);
            floor.gains[which] = value;
            return (floor, vec![("actuator", which as f64 + 1.0), ("gain", value)]);
        }
        "actuation-gain" => {
            floor.gains = [value; ACTUATORS];
            "scale"
        }
        "time-delay" => put(&mut floor.delay_s, value, "delay_s"),
        "hysteresis" => {
            floor.hysteresis = value;
            return (floor, vec![("width", loop_width(value))]);
        }
        _ => put(&mut floor.tilt_deg, value, "angle_deg"),
    };
    (floor, vec![(name, value)])
}

/// Markers of a run without noise: x and z of each in mm, row after row.
pub type Film = Vec<[f64; 2 * MARKERS.len()]>;

/// The nominal robot, in an experiment.
pub fn experiment() -> Experiment {
    let text = format!(
        "{ROBOT}\n[drive]\nwaveform = \"dc\"\nvoltages_v = [0, 0, 0]\n\n[simulation]\ntime_step_s = 1e-5\nduration_s = 1\n"
    );
    experiment::experiment(&Source::from_text("the bench", &text)).expect("the robot of the bench")
}

/// The robot as it is on the bench.
pub fn robot(hidden: &Floor) -> Robot {
    let mut robot = experiment().robot;
    robot.extensions.slope = hidden.slope_deg.to_radians();
    robot.friction.ground *= hidden.friction;
    robot.extensions.stick_slip.ratio = hidden.static_ratio;
    robot.extensions.restitution = hidden.restitution;
    robot
}

/// All runs where nothing is hidden.
pub fn nominal() -> &'static Vec<Film> {
    static NOMINAL: OnceLock<Vec<Film>> = OnceLock::new();
    NOMINAL.get_or_init(|| film(&Floor::default()))
}

/// All runs without noise.
pub fn film(hidden: &Floor) -> Vec<Film> {
    WAVES.par_iter().map(|wave| film_of(hidden, wave)).collect()
}

fn film_of(hidden: &Floor, wave: &Wave) -> Film {
    let robot = robot(hidden);
    let steps_per_row = if hidden.restitution > 0.0 { STEPS_PER_ROW_WITH_RESTITUTION } else { STEPS_PER_ROW };
    let h = ROW / steps_per_row as f64;
    let mut engine = BulletEngine::new(&robot, h).expect("a robot for Bullet");
    let lengths: Vec<f64> = robot.segments().iter().map(|segment| segment.length).collect();
    let mut nodes = vec![0.0; 3 * (lengths.len() + 1)];
    let mut rates = nodes.clone();
    let mut plays: Vec<Plays> = (0..ACTUATORS).map(|_| Plays::new(hidden.hysteresis, 0.0)).collect();
    let mut film = Film::new();
    for step in 0..=(REST + ROWS - 1) * steps_per_row {
        // Bullet applies a torque over the step that follows: the voltage is that of the step's middle.
        let t = (step as f64 + 0.5) * h - (REST * steps_per_row) as f64 * h;
        let volts: Vec<f64> =
            (0..ACTUATORS).map(|k| hidden.gains[k] * plays[k].follow(wave.volts(t - hidden.delay_s, k))).collect();
        engine.prepare(&volts).expect("a step");
        if step % steps_per_row == 0 && step >= REST * steps_per_row {
            engine.nodes(&mut nodes, &mut rates).expect("where the nodes are");
            film.push(seen(hidden, &lengths, &nodes));
        }
        engine.advance().expect("a step");
        if hidden.in_plane {
            keep_in_plane(&mut engine);
        }
    }
    film
}

/// Takes out what the base has of motion across the plane and of turns about axes in it. The joints turn about y alone.
fn keep_in_plane(engine: &mut BulletEngine) {
    let (world, body) = engine.world();
    let mut base = world.base_state(body).expect("where the base is");
    let [_, y, _, w] = base.orientation;
    base.orientation = [0.0, y / y.hypot(w), 0.0, w / y.hypot(w)];
    (base.position[1], base.velocity[1]) = (0.0, 0.0);
    (base.angular_velocity[0], base.angular_velocity[2]) = (0.0, 0.0);
    world.set_base_state(body, &base).expect("a base in the plane");
}

/// The markers on the camera's picture.
pub fn seen(hidden: &Floor, lengths: &[f64], nodes: &[f64]) -> [f64; 2 * MARKERS.len()] {
    let (sin, cos) = hidden.tilt_deg.to_radians().sin_cos();
    let mut row = [0.0; 2 * MARKERS.len()];
    for (at, (_, arc)) in row.chunks_exact_mut(2).zip(MARKERS) {
        let (mut link, mut left) = (0, arc);
        while link + 1 < lengths.len() && left > lengths[link] {
            left -= lengths[link];
            link += 1;
        }
        let share = left / lengths[link];
        let [x, z] = [0, 2].map(|axis| nodes[3 * link + axis] * (1.0 - share) + nodes[3 * link + 3 + axis] * share);
        let (x, z) = (10.0 * (x + 0.5 * lengths[0]), 10.0 * z);
        (at[0], at[1]) = (x * cos - z * sin, x * sin + z * cos);
    }
    row
}

/// Root mean square of the difference of two films (mm).
pub fn trace(a: &[Film], b: &[Film]) -> f64 {
    let pairs = a.iter().flatten().flatten().zip(b.iter().flatten().flatten());
    let (sum, count) = pairs.fold((0.0, 0.0), |(sum, count), (x, y)| (sum + (x - y) * (x - y), count + 1.0));
    f64::sqrt(sum / count)
}

/// Writes dataset.toml and the CSV files of films, with noise.
pub fn write(folder: &Path, films: &[Film], noise_mm: f64, seed: u64) {
    let mut text = format!("[dataset]\nname = \"floor\"\n{ROBOT}\n[markers]\n");
    for (name, arc) in MARKERS {
        let _ = writeln!(text, "{name} = {}", 10.0 * arc);
    }
    let _ = writeln!(text, "\n[noise]\ndefault_mm = {noise_mm}");
    let mut random = Random::with_purpose(seed, "camera over the floor");
    for (wave, film) in WAVES.iter().zip(films) {
        let _ = write!(text, "\n[[run]]\nid = \"{0}\"\nfile = \"{0}.csv\"\n", wave.id);
        let mut table = String::from("t_s,v1_v,v2_v,v3_v");
        MARKERS.iter().for_each(|(name, _)| _ = write!(table, ",{name}_x_mm,{name}_z_mm"));
        table.push('\n');
        for (row, markers) in film.iter().enumerate() {
            let t = row as f64 * ROW;
            let _ = write!(table, "{t:.4}");
            (0..ACTUATORS).for_each(|k| _ = write!(table, ",{:.3}", wave.volts(t, k)));
            markers.iter().for_each(|value| _ = write!(table, ",{:.4}", value + noise_mm * random.normal()));
            table.push('\n');
        }
        std::fs::write(folder.join(format!("{}.csv", wave.id)), table).expect("the CSV of a run");
    }
    std::fs::write(folder.join("dataset.toml"), text).expect("dataset.toml");
}
