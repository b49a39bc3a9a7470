//! Constants identified from single numbers: against the beam's closed forms, known truths, and what is refused.

mod common;

use std::fs;
use std::path::Path;
use std::process::Command;

use common::long::long;
use common::sfers;
use serde_json::Value;
use sfers::analytic::cantilever_frequency;
use sfers::model::{Laminate, Robot};

fn identified(folder: &Path, text: &str) -> Value {
    fs::write(folder.join("d.toml"), text).unwrap();
    let output = sfers(folder, &["diagnose", "d.toml", "--out", "out", "--json", "--quiet"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn constant<'a>(found: &'a Value, key: &str) -> &'a Value {
    found["constants"].as_array().unwrap().iter().find(|constant| constant["key"] == key).unwrap()
}

fn within(found: &Value, key: &str, truth: f64) -> bool {
    let range = &constant(found, key)["range95"];
    (range[0].as_f64().unwrap()..=range[1].as_f64().unwrap()).contains(&truth)
}

/// Frequency and sag of a clamped beam of Euler and Bernoulli whose stiffness and mass are 1.2 and 0.9 times the nominal ones.
fn beam(vary: &str) -> String {
    let robot = Robot::cantilever();
    let laminate = Laminate::new(&robot.material);
    let frequency = cantilever_frequency(&robot) * (1.2_f64 / 0.9).sqrt();
    let load = laminate.areal_density * robot.material.gravity * 0.9;
    let sag = -10.0 * load * robot.material.actuator_length.powi(4) / (8.0 * 1.2 * laminate.flexural_rigidity);
    let (tip_sigma, frequency_sigma) = (0.01 * sag.abs(), 0.01 * frequency);
    format!(
        "[robot]\nactuators = 1\nmotors_per_actuator = 12\nmount = \"clamped\"\ndamping_eta = 0.002\n[identify]\nseed = 3\n[identify.vary]\n{vary}\n\
         [[observation]]\nmeasure = \"resonance_hz\"\nvalue = {frequency}\nsigma = {frequency_sigma}\ndrive = {{ waveform = \"sine\", amplitude_v = -1500 }}\n\
         simulation = {{ time_step_s = 2e-4, duration_s = 1 }}\n[[observation]]\nmeasure = \"tip_deflection_mm\"\nvalue = {sag}\nsigma = {tip_sigma}\n\
         drive = {{ waveform = \"dc\", voltages_v = [0] }}\nsimulation = {{ start = \"settled\", time_step_s = 2e-4, duration_s = 0.01 }}\n"
    )
}

#[test]
fn the_stiffness_of_a_beam_is_found_and_its_mass_beside_it_is_tied() {
    let folder = tempfile::tempdir().unwrap();
    let stiffness = "\"effect.stiffness.scale\" = { from = 0.6, to = 1.8 }";
    let mass = "\"effect.areal-mass.scale\" = { from = 0.6, to = 1.6 }";
    // Alone it is stiffness over mass, 1.2/0.9; each of the two numbers knows it to 2 and 1 %.
    let alone = identified(folder.path(), &beam(stiffness));
    assert!(within(&alone, "effect.stiffness.scale", 1.2 / 0.9), "{alone}");
    let value = constant(&alone, "effect.stiffness.scale")["value"].as_f64().unwrap();
    assert!((value / (1.2 / 0.9) - 1.0).abs() < 0.02, "{value}");
    assert_eq!((alone["meets_all"].as_bool(), alone["is_set"].as_bool()), (Some(true), Some(false)), "{alone}");
    let both = identified(folder.path(), &beam(&format!("{stiffness}\n{mass}")));
    let [s, m] = ["effect.stiffness.scale", "effect.areal-mass.scale"].map(|key| constant(&both, key));
    assert!(within(&both, "effect.stiffness.scale", 1.2) && within(&both, "effect.areal-mass.scale", 0.9), "{both}");
    assert_eq!(s["tied_with"][0][0], "effect.areal-mass.scale", "{both}");
    assert!(s["tied_with"][0][1].as_f64().unwrap() > 0.9, "{both}");
    let ratio = s["value"].as_f64().unwrap() / m["value"].as_f64().unwrap();
    assert!((ratio / (1.2 / 0.9) - 1.0).abs() < 0.02, "{both}");
}

/// The beam's stiffness over mass is 1.33 times the nominal; all that are searched are 1.6 times and more, off by nine standard deviations and more.
#[test]
fn there_are_no_ranges_where_the_search_leaves_the_robot_out() {
    let folder = tempfile::tempdir().unwrap();
    let found = identified(folder.path(), &beam("\"effect.stiffness.scale\" = { from = 1.6, to = 2.0 }"));
    assert!(constant(&found, "effect.stiffness.scale")["range95"].is_null(), "{found}");
    assert_eq!((found["meets_all"].as_bool(), found["corners"].as_array().unwrap().len()), (Some(false), 0), "{found}");
    assert!(found["summary"].as_str().unwrap().contains("there are no 95 % ranges"), "{found}");
}

#[test]
fn fewer_numbers_than_constants_give_a_set_with_its_corners_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let vary = "\"effect.stiffness.scale\" = { from = 0.8, to = 1.6 }\n\"effect.areal-mass.scale\" = { from = 0.8, to = 1.2 }\n\
                \"robot.damping_eta\" = { values = [0.002, 0.003] }";
    let found = identified(folder.path(), &beam(vary));
    assert_eq!(found["is_set"], true);
    assert_eq!(found["corners"].as_array().unwrap().len(), 4, "{found}");
    assert!(found["summary"].as_str().unwrap().contains("the answer is a set"), "{found}");
    let files = ["identification.json", "identified.toml", "report.html"];
    let read = |out: &str| files.map(|file| fs::read(folder.path().join(out).join(file)).unwrap());
    let first = read("out");
    let again = sfers(folder.path(), &["diagnose", "d.toml", "--out", "out", "--jobs", "1", "--quiet"]);
    assert!(again.status.success());
    assert_eq!(first, read("out"));
    let run = sfers(folder.path(), &["run", "out/identified.toml", "--quiet"]);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
}

#[test]
fn whatever_is_no_identification_is_refused_with_file_line_and_key() {
    let folder = tempfile::tempdir().unwrap();
    let good = "\"effect.stiffness.scale\" = { from = 0.8, to = 1.6 }";
    let cases = [
        (beam(""), vec!["line 6", "identify", "no constants"]),
        (beam("\"robot.legs\" = { from = 1, to = 2 }"), vec!["line 9", "robot.legs"]),
        (beam("\"robot.damping_eta\" = { from = 2, to = 1 }"), vec!["line 9", "robot.damping_eta", "from 2 to 1"]),
        (beam("\"robot.damping_eta\" = { from = 2 }"), vec!["line 9", "needs from and to, or values"]),
        (beam("\"robot.damping_eta\" = { from = -1, to = 1 }"), vec!["line 9", "robot.damping_eta", "zero or more"]),
        (
            beam("\"effect.stiffness.size\" = { from = 1, to = 2 }"),
            vec!["line 9", "effect.stiffness.size", "effect.ID.PARAMETER"],
        ),
        (beam("damping = { from = 1, to = 2 }"), vec!["line 9", "damping", "table"]),
        (beam(good).replace("sigma =", "role = \"foretell\"\nsigma ="), vec!["identify", "nothing to fit"]),
        (beam(good).replace("\"tip_deflection_mm\"", "\"jump_height_mm\""), vec!["observation 2", "jump_height_mm"]),
        (beam(good).replacen("sigma =", "# sigma =", 1), vec!["sigma"]),
        (
            beam(good)
                .replace("[identify]\nseed = 3\n[identify.vary]\n", "")
                .replace(good, "")
                .replace("sigma =", "role = \"foretell\"\nsigma ="),
            vec!["role", "belongs to a data set with [identify]"],
        ),
    ];
    for (text, words) in cases {
        fs::write(folder.path().join("d.toml"), &text).unwrap();
        let output = sfers(folder.path(), &["diagnose", "d.toml", "--out", "none", "--quiet"]);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{text}: {error}");
        assert!(words.iter().all(|word| error.contains(word)) && error.contains("d.toml"), "{text}: {error}");
        assert!(!folder.path().join("none/identification.json").exists());
    }
}

/// Numbers in equal parts of 0 to 1 (splitmix64).
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// From `low` to `high`, evenly in ratios.
    fn ratio(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    /// Of the standard normal distribution (Box and Muller).
    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.unit()).ln()).sqrt() * (2.0 * std::f64::consts::PI * self.unit()).cos()
    }
}

const FITTED_HZ: [u32; 12] = [1, 2, 3, 4, 6, 8, 9, 10, 12, 14, 15, 16];
const FORETOLD_HZ: [u32; 4] = [5, 7, 11, 13];
const JUMPS_HZ: [u32; 3] = [8, 11, 14];
const RANGES: [(&str, [f64; 2], [f64; 2]); 3] = [
    ("robot.friction.low", [0.4, 2.0], [0.2, 4.0]),
    ("robot.friction.high", [2.5, 7.0], [2.0, 9.0]),
    ("robot.damping_eta", [0.006, 0.05], [0.003, 0.1]),
];

/// A data set of a robot with known constants, which other time steps and perturbed angles measure to 5 %, and the constants to be found; the share of the film is
/// one of them, or given.
fn known_truth(folder: &Path, seed: u64, film_is_known: bool) -> (String, Vec<(&'static str, f64)>) {
    let mut random = Random(seed);
    let mut truth: Vec<(&str, f64)> = RANGES.iter().map(|(key, [low, high], _)| (*key, random.ratio(*low, *high))).collect();
    truth.push(("robot.friction.film_fraction", [0.1, 0.4, 0.7][(3.0 * random.unit()) as usize]));
    let angles: Vec<f64> = (0..15).map(|_| 5e-4 * random.normal()).collect();
    let measured = |preset: &str, hz: u32, measure: &str, duration: f64| -> f64 {
        let constants = truth.iter().map(|(key, value)| format!("{key}={value}"));
        let others = [
            format!("drive.frequency_hz={hz}"),
            "robot.friction.film=both-ends".into(),
            "simulation.time_step_s=2.3e-5".into(),
            format!("simulation.duration_s={duration}"),
            format!("simulation.joint_angles_rad={angles:?}"),
            "simulation.record_every_s=0.1".into(),
        ];
        let mut command = Command::new(env!("CARGO_BIN_EXE_sfers"));
        command.args(["run", &format!("preset:{preset}"), "--engine", "planar", "--json", "--quiet"]).current_dir(folder);
        for setting in constants.chain(others) {
            command.args(["--set", &setting]);
        }
        let output = command.output().unwrap();
        let run: Value = serde_json::from_slice(&output.stdout).unwrap();
        run["measures"][measure].as_f64().unwrap_or_else(|| panic!("{}", String::from_utf8_lossy(&output.stderr)))
    };
    let mut text = "[robot]\nactuators = 5\nmotors_per_actuator = 3\nmount = \"ground\"\n".to_owned();
    if film_is_known {
        text += &format!("[robot.friction]\nfilm_fraction = {:?}\n", truth[RANGES.len()].1);
    }
    text += "[identify]\nseed = 1\n[identify.vary]\n";
    for (key, _, [from, to]) in RANGES {
        text += &format!("\"{key}\" = {{ from = {from:?}, to = {to:?} }}\n");
    }
    if !film_is_known {
        text += "\"robot.friction.film_fraction\" = { values = [0.1, 0.4, 0.7] }\n";
    }
    let mut observe = |preset: &str, hz: u32, measure: &str, duration: f64, role: &str| {
        let value = measured(preset, hz, measure, duration);
        let sigma = (0.05 * value.abs()).max(0.02);
        text += &format!(
            "[[observation]]\nmeasure = \"{measure}\"\nvalue = {:?}\nsigma = {sigma:?}\nrole = \"{role}\"\n\
             drive = {{ waveform = \"gait\", gait = \"{preset}\", frequency_hz = {hz} }}\nsimulation = {{ time_step_s = 1e-4, duration_s = {duration:?} }}\n",
            value + sigma * random.normal()
        );
    };
    FITTED_HZ.iter().for_each(|hz| observe("full-frictional-inchworm", *hz, "speed_mm_s", 3.0, "fit"));
    JUMPS_HZ.iter().for_each(|hz| observe("crawl", *hz, "jump_height_mm", 1.2, "fit"));
    FORETOLD_HZ.iter().for_each(|hz| observe("full-frictional-inchworm", *hz, "speed_mm_s", 3.0, "foretell"));
    if film_is_known {
        truth.pop();
    }
    (text, truth)
}

/// Friction, damping and film drawn at random, 12 speeds and 3 jump heights to 5 %. One truth whose film is given; with SFERS_LONG=1 twenty, of which 90 to 99 % of
/// the values must lie in their ranges and the signs of 90 % of the speeds that were left out be right.
#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn known_truths_lie_in_their_ranges_and_left_out_speeds_have_their_signs() {
    let seeds = if long() { 101..=120 } else { 101..=101 };
    let many = seeds.clone().count() > 1;
    let [mut inside, mut values, mut signs, mut speeds] = [0; 4];
    for seed in seeds {
        let folder = tempfile::tempdir().unwrap();
        let (text, truth) = known_truth(folder.path(), seed, !many);
        let found = identified(folder.path(), &text);
        for (key, truth) in truth {
            let listed = found["listed"].as_array().unwrap().iter().find(|constant| constant["key"] == key);
            let is_inside = match listed {
                Some(listed) => listed["possible"].as_array().unwrap().iter().any(|value| value.as_f64() == Some(truth)),
                None => within(&found, key, truth),
            };
            println!("seed {seed}: {key} = {truth}, {}", if is_inside { "inside" } else { "MISSED" });
            (inside, values) = (inside + u32::from(is_inside), values + 1);
        }
        for fact in found["facts"].as_array().unwrap().iter().filter(|fact| fact["is_fitted"] == false) {
            let [value, predicted] = ["value", "predicted"].map(|key| fact[key].as_f64().unwrap());
            (signs, speeds) = (signs + u32::from((value > 0.0) == (predicted > 0.0)), speeds + 1);
        }
    }
    println!("{inside} of {values} inside, {signs} of {speeds} signs");
    if many {
        let share = f64::from(inside) / f64::from(values);
        assert!(
            (0.9..=0.99).contains(&share) && f64::from(signs) >= 0.9 * f64::from(speeds),
            "{inside}/{values}, {signs}/{speeds}"
        );
    } else {
        // Of one truth one miss in three is no surprise at 95 %.
        assert!(inside >= 2 && signs >= 2, "{inside} of {values}, {signs} of {speeds}");
    }
}
