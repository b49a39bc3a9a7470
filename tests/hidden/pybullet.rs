//! Films of the robot of [`ground`](super::ground) by the authors' recipe on a live PyBullet, which knows nothing of this library: free to turn, laminate,
//! drive and torque law of its own.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use rayon::prelude::*;
use serde_json::json;
use sfers::recording::npz;

use super::generator::protocol::Plays;
use super::ground::{ACTUATORS, Film, Floor, REST, ROW, ROWS, STEPS_PER_ROW, WAVES, Wave, experiment, seen};

/// Time between the voltages of the table that PyBullet gets (s).
const LOGGED: f64 = 5e-4;

/// All runs without noise. Restitution and static friction are not in the recipe.
pub fn film(python: &Path, hidden: &Floor) -> Vec<Film> {
    assert!(hidden.restitution == 0.0 && hidden.static_ratio == 1.0, "not in the authors' recipe");
    WAVES.par_iter().map(|wave| film_of(python, hidden, wave)).collect()
}

fn film_of(python: &Path, hidden: &Floor, wave: &Wave) -> Film {
    let folder = tempfile::tempdir().expect("a folder for a recording");
    let out = folder.path().join("recording.npz");
    let h = ROW / STEPS_PER_ROW as f64;
    let experiment = experiment();
    let mut spec = experiment.spec();
    spec["friction"]["ground"] = json!(experiment.robot.friction.ground * hidden.friction);
    spec["drive"] = table(hidden, wave);
    spec["time_step"] = json!(h);
    spec["steps"] = json!((REST + ROWS - 1) * STEPS_PER_ROW);
    spec["record_every_steps"] = json!(STEPS_PER_ROW);
    spec["out"] = json!(out);
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut child = Command::new(python)
        .arg(tests.join("tests/hidden/sloped.py"))
        .arg(tests.join("src/crosscheck/reference.py"))
        .arg(hidden.slope_deg.to_radians().to_string())
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .expect("Python");
    child.stdin.take().expect("a pipe").write_all(spec.to_string().as_bytes()).expect("a spec that is read");
    assert!(child.wait().expect("an end").success(), "the recipe failed on {}", wave.id);
    let recording = npz::read_file(&out).expect("a recording");
    let lengths: Vec<f64> = experiment.robot.segments().iter().map(|segment| segment.length).collect();
    let film_of_record = |record: usize| {
        let nodes: Vec<f64> = (0..recording.nodes()).flat_map(|node| recording.node(record, node)).collect();
        seen(hidden, &lengths, &nodes)
    };
    // The record before the first step is no row of the film; record k is the state at the end of k rows.
    (REST..REST + ROWS).map(film_of_record).collect()
}

/// The voltages that reach the actuators, as a table from the beginning of the rest on.
fn table(hidden: &Floor, wave: &Wave) -> serde_json::Value {
    let rest = REST as f64 * ROW;
    let count = ((REST + ROWS) as f64 * ROW / LOGGED) as usize;
    let mut plays: Vec<Plays> = (0..ACTUATORS).map(|_| Plays::new(hidden.hysteresis, 0.0)).collect();
    let times: Vec<f64> = (0..=count).map(|i| i as f64 * LOGGED).collect();
    let volts = |t: &f64| -> Vec<f64> {
        (0..ACTUATORS).map(|k| hidden.gains[k] * plays[k].follow(wave.volts(t - rest - hidden.delay_s, k))).collect()
    };
    let rows: Vec<Vec<f64>> = times.iter().map(volts).collect();
    json!({ "waveform": "table", "times": times, "voltages": rows })
}
