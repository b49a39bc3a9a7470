//! What can be hidden: the nature of a plant, and the values drawn for it.

use super::Hidden;
use super::chain::BRANCHES;
use super::forms::Other;
use super::protocol::{Plays, RUNS};
use super::random::Random;

/// Number of play operators of the hysteresis; their radii go up to 1500 V.
pub const RADII: usize = 12;

/// A cable that carries the tip while it is below a level.
#[derive(Clone)]
pub struct Cable {
    pub level_cm: f64,
    pub stiffness: f64,
    pub damping: f64,
    pub force: f64,
}

/// A second mass on a spring under the clamp, moving up and down.
#[derive(Clone)]
pub struct Fixture {
    pub mass_g: f64,
    pub stiffness: f64,
    pub damping: f64,
}

/// Motion of all markers that has nothing to do with the drive.
#[derive(Clone)]
pub struct Hum {
    pub hertz: f64,
    pub amplitude_mm: f64,
    pub phases: [f64; RUNS.len()],
}

/// Everything that can differ from the nominal plant, in CGS units; the default is nominal.
#[derive(Clone)]
pub struct Nature {
    pub stiffness: f64,
    pub gain: f64,
    pub damping: f64,
    pub areal_mass: f64,
    pub clamp_rad_per_dyn_cm: f64,
    pub tip_mass_g: f64,
    pub curvature_per_cm: f64,
    pub softening_cm2: f64,
    pub friction_dyn_cm: f64,
    pub loss: f64,
    pub drag: f64,
    pub hysteresis: f64,
    pub creep: f64,
    pub slope_per_v: f64,
    pub ratio: f64,
    pub margin: f64,
    pub lag_s: f64,
    pub slew_v_per_s: f64,
    pub delay_s: f64,
    pub low_v: f64,
    pub sensor_scale: f64,
    pub offset_mm: [f64; 2],
    pub sensor_delay_s: f64,
    pub tilt_rad: f64,
    pub run_gains: [f64; RUNS.len()],
    /// Time in s and length in mm by which the tip marker slips towards the clamp, run by run.
    pub slips: [Option<(f64, f64)>; RUNS.len()],
    pub cable: Option<Cable>,
    pub fixture: Option<Fixture>,
    pub hum: Option<Hum>,
    pub remanence: f64,
    /// Effects by other equations.
    pub other: Other,
}

impl Default for Nature {
    fn default() -> Nature {
        Nature {
            stiffness: 1.0,
            gain: 1.0,
            damping: 1.0,
            areal_mass: 1.0,
            clamp_rad_per_dyn_cm: 0.0,
            tip_mass_g: 0.0,
            curvature_per_cm: 0.0,
            softening_cm2: 0.0,
            friction_dyn_cm: 0.0,
            loss: 0.0,
            drag: 0.0,
            hysteresis: 0.0,
            creep: 0.0,
            slope_per_v: 0.0,
            ratio: 1.0,
            margin: 0.0,
            lag_s: 0.0,
            slew_v_per_s: f64::INFINITY,
            delay_s: 0.0,
            low_v: f64::NEG_INFINITY,
            sensor_scale: 1.0,
            offset_mm: [0.0; 2],
            sensor_delay_s: 0.0,
            tilt_rad: 0.0,
            run_gains: [1.0; RUNS.len()],
            slips: [None; RUNS.len()],
            cable: None,
            fixture: None,
            hum: None,
            remanence: 0.0,
            other: Other::default(),
        }
    }
}

/// Ranges of the value for a small, medium and large trace (0.15-0.3, 0.3-0.75 and 0.75-2 mm), on one or both sides of the value
/// that hides nothing. The bounds of the library cut a few of them short: those cannot reach a large trace.
struct Sizes {
    id: &'static str,
    up: [(f64, f64); 3],
    down: Option<[(f64, f64); 3]>,
}

const fn one(id: &'static str, up: [(f64, f64); 3]) -> Sizes {
    Sizes { id, up, down: None }
}

const fn two(id: &'static str, up: [(f64, f64); 3], down: [(f64, f64); 3]) -> Sizes {
    Sizes { id, up, down: Some(down) }
}

const SIZES: &[Sizes] = &[
    two(
        "stiffness",
        [(1.00392, 1.0065), (1.0077, 1.0167), (1.0192, 1.0504)],
        [(0.99616, 0.9937), (0.9926, 0.9846), (0.9825, 0.9596)],
    ),
    two(
        "actuation-gain",
        [(1.0173, 1.0284), (1.0335, 1.0711), (1.0813, 1.194)],
        [(0.9828, 0.9717), (0.9666, 0.9293), (0.9193, 0.809)],
    ),
    two("damping", [(1.0263, 1.0439), (1.0522, 1.117), (1.136, 1.39)], [(0.9748, 0.9591), (0.9521, 0.9029), (0.8904, 0.7686)]),
    two(
        "areal-mass",
        [(1.00386, 1.0063), (1.0075, 1.0157), (1.0179, 1.0422)],
        [(0.9961, 0.99355), (0.9924, 0.9836), (0.9812, 0.952)],
    ),
    one("clamp-compliance", [(0.0192, 0.0314), (0.037, 0.0772), (0.0879, 0.203)]),
    one("tip-mass", [(0.00462, 0.0076), (0.00894, 0.0188), (0.0214, 0.0505)]),
    two(
        "initial-curvature",
        [(0.0663, 0.109), (0.129, 0.273), (0.312, 0.742)],
        [(-0.0663, -0.109), (-0.129, -0.273), (-0.312, -0.741)],
    ),
    two("stiffness-softening", [(18.8, 30.6), (35.9, 73.7), (83.6, 191.0)], [(-19.7, -32.9), (-39.1, -88.1), (-103.0, -317.0)]),
    one("dry-friction", [(0.13, 0.218), (0.259, 0.563), (0.646, 0.95)]),
    one("structural-damping", [(0.000828, 0.00137), (0.00162, 0.00355), (0.00409, 0.0108)]),
    one("air-drag", [(0.433, 0.736), (0.879, 2.09), (2.45, 3.8)]),
    one("hysteresis", [(0.072, 0.116), (0.135, 0.266), (0.298, 0.475)]),
    one("creep", [(0.00974, 0.016), (0.0189, 0.0401), (0.0458, 0.052)]),
    one("field-dependent-gain", [(0.0154, 0.0253), (0.0298, 0.0633), (0.0724, 0.173)]),
    two("polarity-asymmetry", [(1.32, 1.53), (1.62, 1.95), (2.0, 2.14)], [(0.72, 0.66), (0.64, 0.59), (0.57, 0.525)]),
    one("passive-margin", [(0.015, 0.0247), (0.0291, 0.0618), (0.0706, 0.1686)]),
    one("driver-lag", [(0.000196, 0.000323), (0.000381, 0.000808), (0.000925, 0.00226)]),
    one("slew-limit", [(3.59e5, 2.16e5), (1.83e5, 9.38e4), (8.66e4, 5.13e4)]),
    one("time-delay", [(0.000196, 0.000323), (0.000381, 0.000809), (0.000925, 0.00221)]),
    one("saturation", [(-1394.0, -1343.0), (-1321.0, -1189.0), (-1162.0, -928.0)]),
    two(
        "sensor-scale",
        [(1.00305, 1.00503), (1.00593, 1.0126), (1.0144, 1.0341)],
        [(0.99695, 0.99497), (0.99407, 0.9874), (0.9856, 0.9659)],
    ),
    one("sensor-offset", [(0.24, 0.396), (0.467, 0.99), (1.13, 2.69)]),
    one("sensor-delay", [(0.000196, 0.000323), (0.000381, 0.000809), (0.000925, 0.00221)]),
    two("camera-tilt", [(0.175, 0.288), (0.34, 0.721), (0.824, 1.956)], [(-0.175, -0.288), (-0.34, -0.721), (-0.824, -1.956)]),
    one("drifting-gain", [(0.018, 0.03), (0.035, 0.055), (0.06, 0.09)]),
    one("marker-slip", [(0.05, 0.08), (0.2, 0.27), (0.45, 0.54)]),
    one("cable-drag", [(160.0, 265.0), (313.0, 674.0), (774.0, 1978.0)]),
    one("resonant-fixture", [(250.0, 150.0), (110.0, 60.0), (45.0, 25.0)]),
    one("mains-hum", [(0.3, 0.4), (0.4, 0.5), (0.5, 0.6)]),
    one("remanence", [(0.0169, 0.0279), (0.0328, 0.0696), (0.0796, 0.189)]),
];

/// Draws a value of the size asked for.
fn draw(id: &str, size: usize, random: &mut Random) -> f64 {
    let sizes = SIZES.iter().find(|s| s.id == id).unwrap_or_else(|| panic!("no effect {id}"));
    let side = match sizes.down {
        Some(down) if random.uniform() < 0.5 => down,
        _ => sizes.up,
    };
    random.between(side[size].0, side[size].1)
}

/// Hides an effect of a size in a plant.
pub fn hide(id: &'static str, size: usize, seed: u64, nature: &mut Nature) -> Hidden {
    let mut random = Random::with_purpose(seed, &format!("{id} {size}"));
    let value = draw(id, size, &mut random);
    Hidden { id, parameters: set(id, value, nature, &mut random) }
}

/// Hides an effect of a given value in a plant, and says its parameters in the units of the library.
pub fn set(id: &str, value: f64, nature: &mut Nature, random: &mut Random) -> Vec<(&'static str, f64)> {
    let name = match id {
        "stiffness" => put(&mut nature.stiffness, value, "scale"),
        "actuation-gain" => put(&mut nature.gain, value, "scale"),
        "damping" => put(&mut nature.damping, value, "scale"),
        "areal-mass" => put(&mut nature.areal_mass, value, "scale"),
        "clamp-compliance" => put(&mut nature.clamp_rad_per_dyn_cm, 1e-7 * value, "compliance_rad_per_n_m"),
        "tip-mass" => {
            nature.tip_mass_g = value;
            return vec![("mass_g", value), ("position_mm", 100.0)];
        }
        "initial-curvature" => put(&mut nature.curvature_per_cm, 0.01 * value, "curvature_per_m"),
        "stiffness-softening" => put(&mut nature.softening_cm2, 0.01 * value, "softening_mm2"),
        "dry-friction" => put(&mut nature.friction_dyn_cm, 1e4 * value, "moment_mn_m"),
        "structural-damping" => {
            nature.loss = value;
            return vec![("loss_factor", loss_factor(value, 10.0))];
        }
        "air-drag" => put(&mut nature.drag, value, "drag_coefficient"),
        "hysteresis" => {
            nature.hysteresis = value;
            return vec![("width", loop_width(value))];
        }
        "creep" => {
            nature.creep = value;
            // Two branches in a decade.
            return vec![("per_decade", 2.0 * value)];
        }
        "field-dependent-gain" => {
            nature.slope_per_v = 1e-3 * value;
            return vec![("slope_per_kv", value), ("curvature_per_kv2", 0.0)];
        }
        "polarity-asymmetry" => put(&mut nature.ratio, value, "ratio"),
        "passive-margin" => put(&mut nature.margin, value, "fraction"),
        "driver-lag" => put(&mut nature.lag_s, value, "time_constant_s"),
        "slew-limit" => put(&mut nature.slew_v_per_s, value, "rate_v_per_s"),
        "time-delay" => put(&mut nature.delay_s, value, "delay_s"),
        "saturation" => put(&mut nature.low_v, value, "min_v"),
        "sensor-scale" => put(&mut nature.sensor_scale, value, "scale"),
        "sensor-offset" => return offset(value, nature, random),
        "sensor-delay" => put(&mut nature.sensor_delay_s, value, "delay_s"),
        "camera-tilt" => put(&mut nature.tilt_rad, value.to_radians(), "angle_deg"),
        "drifting-gain" => return drift(value, nature, random),
        "marker-slip" => return slip(value, nature, random),
        "cable-drag" => return cable(value, nature, random),
        "resonant-fixture" => return fixture(value, nature, random),
        "mains-hum" => return hum(value, nature, random),
        "remanence" => put(&mut nature.remanence, value, "share"),
        _ => panic!("no effect {id}"),
    };
    vec![(name, value)]
}

pub fn put(place: &mut f64, value: f64, name: &'static str) -> &'static str {
    *place = value;
    name
}

/// Phase of the modulus, as a tangent, of a joint with lossy branches of the same weight.
fn loss_factor(loss: f64, hertz: f64) -> f64 {
    let (mut real, mut imaginary) = (1.0, 0.0);
    for time in BRANCHES {
        let x = std::f64::consts::TAU * hertz * time;
        real += loss * x * x / (1.0 + x * x);
        imaginary += loss * x / (1.0 + x * x);
    }
    imaginary / real
}

/// Largest distance between the branches of the loop from 0 to -1500 V and back, as a share of the stroke.
pub fn loop_width(share: f64) -> f64 {
    let mut plays = Plays::new(share, 0.0);
    let (mut down, mut up) = (Vec::new(), Vec::new());
    for _ in 0..2 {
        down = (0..=1500).map(|v| plays.follow(-f64::from(v))).collect();
        up = (0..=1500).rev().map(|v| plays.follow(-f64::from(v))).collect();
    }
    down.iter().zip(up.iter().rev()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / 1500.0
}

/// An offset of a given length in a direction drawn.
fn offset(length: f64, nature: &mut Nature, random: &mut Random) -> Vec<(&'static str, f64)> {
    let angle = random.between(0.0, std::f64::consts::TAU);
    nature.offset_mm = [length * angle.cos(), length * angle.sin()];
    vec![("x_mm", nature.offset_mm[0]), ("z_mm", nature.offset_mm[1])]
}

/// A random walk of the gain from run to run, about 1, with the root mean square given.
fn drift(rms: f64, nature: &mut Nature, random: &mut Random) -> Vec<(&'static str, f64)> {
    let mut place = 0.0;
    let walk: [f64; RUNS.len()] = std::array::from_fn(|_| {
        place += random.normal();
        place
    });
    let mean = walk.iter().sum::<f64>() / RUNS.len() as f64;
    let spread = (walk.iter().map(|g| (g - mean) * (g - mean)).sum::<f64>() / RUNS.len() as f64).sqrt();
    nature.run_gains = walk.map(|g| 1.0 + rms * (g - mean) / spread);
    vec![("rms", rms)]
}

/// The tip marker slips in a share of the runs, by 1 to 3 mm.
fn slip(share: f64, nature: &mut Nature, random: &mut Random) -> Vec<(&'static str, f64)> {
    let runs = (share * RUNS.len() as f64).ceil() as usize;
    let mut order: Vec<usize> = (0..RUNS.len()).collect();
    for i in (1..order.len()).rev() {
        order.swap(i, random.below(i + 1));
    }
    let mut largest = 0.0f64;
    for &run in order.iter().take(runs) {
        let length = random.between(1.0, 3.0);
        nature.slips[run] = Some((RUNS[run].duration * random.between(0.2, 0.8), length));
        largest = largest.max(length);
    }
    vec![("runs", runs as f64), ("largest_mm", largest)]
}

fn cable(stiffness: f64, nature: &mut Nature, random: &mut Random) -> Vec<(&'static str, f64)> {
    let cable = Cable { level_cm: random.between(-1.5, -0.5), stiffness, damping: 0.004 * stiffness, force: 0.15 * stiffness };
    let parameters = vec![("stiffness_dyn_per_cm", stiffness), ("level_mm", 10.0 * cable.level_cm)];
    nature.cable = Some(cable);
    parameters
}

fn fixture(mass_g: f64, nature: &mut Nature, random: &mut Random) -> Vec<(&'static str, f64)> {
    let hertz = random.between(30.0, 45.0);
    let pulse = std::f64::consts::TAU * hertz;
    nature.fixture = Some(Fixture { mass_g, stiffness: mass_g * pulse * pulse, damping: 0.03 * mass_g * pulse });
    vec![("mass_g", mass_g), ("frequency_hz", hertz)]
}

fn hum(amplitude_mm: f64, nature: &mut Nature, random: &mut Random) -> Vec<(&'static str, f64)> {
    let hertz = if random.uniform() < 0.5 { 50.0 } else { 7.3 };
    let phases = std::array::from_fn(|_| random.between(0.0, std::f64::consts::TAU));
    nature.hum = Some(Hum { hertz, amplitude_mm, phases });
    vec![("frequency_hz", hertz), ("amplitude_mm", amplitude_mm)]
}
