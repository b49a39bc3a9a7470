//! The extended model that a diagnosis writes is the model that was fitted: `sfers run` gives what the fit predicted.

mod common;

use std::fmt::Write;
use std::fs;
use std::path::Path;

use common::sfers;
use sfers::diagnose::dataset::Dataset;
use sfers::diagnose::extended;
use sfers::diagnose::plant::{Model, Nuisance, Plant, Term};
use sfers::diagnose::quality;
use sfers::diagnose::robot::RobotPlant;
use sfers::effects::View;
use sfers::experiment::{self, Control, Source};

/// Agreement (mm): rounding of results that are computed alike.
const SAME: f64 = 1e-9;

/// Short runs of two actuators with jumps and slopes of both signs, all alike, on rows that fall on steps.
fn write(folder: &Path, mount: &str, m: usize, runs: usize) {
    let mut toml = format!(
        "[dataset]\nname = \"x\"\n[robot]\nactuators = 2\nmotors_per_actuator = {m}\nmount = \"{mount}\"\ndamping_eta = 0.01\npositive_gain = 1.2\n\
         [markers]\nmid = 100.0\ntip = 200.0\n[noise]\ndefault_mm = 0.05\n"
    );
    (1..=runs).for_each(|run| write!(toml, "[[run]]\nid = \"{run}\"\nfile = \"a.csv\"\n").unwrap());
    fs::write(folder.join("x.toml"), toml).unwrap();
    let mut rows = String::from("t_s,v1_v,v2_v,mid_x_mm,mid_z_mm,tip_x_mm,tip_z_mm\n");
    for i in 0..60 {
        let t = 0.002 * f64::from(i);
        let first = if i < 12 { 0.0 } else { -900.0 };
        let second = 250.0 * (60.0 * t).sin() - 100.0;
        writeln!(rows, "{t},{first},{second:.2},{0},{0},{0},{0}", 0.01 * (i % 7) as f64).unwrap();
    }
    fs::write(folder.join("a.csv"), rows).unwrap();
}

/// Every jump after 0.4 of its interval.
fn nuisance(plant: &RobotPlant) -> Nuisance {
    Nuisance { shares: vec![0.4; plant.nuisances(0)], ..Nuisance::default() }
}

/// The place (cm) that `view` shows at `seen` (cm), for views that change places little.
fn place_of(view: &View, seen: [f64; 2]) -> [f64; 2] {
    let mut place = seen;
    for _ in 0..50 {
        let shown = view.of(place);
        place = [0, 1].map(|axis| place[axis] + seen[axis] - shown[axis]);
    }
    place
}

/// The largest difference (mm) between what the plant predicts and what the experiment file's recording shows, both at the run's rows.
fn apart(folder: &Path, dataset: &Dataset, plant: &RobotPlant, model: &Model) -> Result<f64, Box<dyn std::error::Error>> {
    let nuisance = nuisance(plant);
    let predicted = plant.predict(model, 0, &nuisance)?;
    let (toml, drive) = extended::experiment(dataset, plant, model, 0, &nuisance.shares);
    fs::write(folder.join("extended.toml"), &toml).unwrap();
    fs::write(folder.join("drive.csv"), drive).unwrap();
    let source = Source::from_file(&folder.join("extended.toml")).unwrap();
    let experiment = experiment::experiment(&source).map_err(|error| format!("{error}\n{toml}"))?;
    let mut engine = experiment.engine().unwrap();
    let recording = experiment::run(&experiment, engine.as_mut(), |_| Control::Continue).unwrap().recording;
    // Both markers stand on joints: at the end, and half way.
    let nodes = recording.nodes();
    let segments = experiment.robot.segments();
    let mut along = 0.0;
    let mut places = Vec::new();
    for segment in &segments {
        places.push(along);
        along += segment.length;
    }
    places.push(along);
    let view = View::new(&experiment.effects);
    let mut worst = 0.0_f64;
    for (i, signal) in predicted.iter().enumerate() {
        let (t, channel) = (plant.signals()[0].times[i], plant.signals()[0].channels[i]);
        let record = recording.time.iter().position(|time| (time - t).abs() < 1e-9).ok_or("no record at a row")?;
        let position = plant.markers()[channel / 2];
        let body = (0..nodes - 1).rev().find(|body| places[*body] < position).unwrap_or(0);
        let share = (position - places[body]) / (places[body + 1] - places[body]);
        // Links are straight, but not in a picture that is bent: a marker lies between the true places of two nodes, from the left end.
        let [left, right] = [body, body + 1].map(|node| {
            let [x, _, z] = recording.node(record, node);
            place_of(&view, [x + 0.5 * segments[0].length, z])
        });
        let seen = view.of([0, 1].map(|axis| left[axis] + share * (right[axis] - left[axis])));
        worst = worst.max((10.0 * seen[channel % 2] - signal).abs());
    }
    Ok(worst)
}

#[test]
fn every_cause_that_a_fit_can_adopt_survives_the_way_through_the_file() {
    for (mount, m) in [("clamped", 3), ("ground", 2)] {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), mount, m, 3);
        let dataset = Dataset::read(&folder.path().join("x.toml")).unwrap();
        let plant = RobotPlant::new(&dataset, &quality::check(&dataset));
        let nominal = Model::new(Vec::new(), m as f64, true);
        let plain = plant.predict(&nominal, 0, &nuisance(&plant)).unwrap();
        let resolutions = [m as f64, 5.0];
        for resolution in resolutions {
            let found = apart(folder.path(), &dataset, &plant, &Model { resolution, ..nominal.clone() }).unwrap();
            assert!(found < SAME, "{mount}, {resolution} joints: {found} mm");
        }
        let (mut moved, mut refused) = (0, Vec::new());
        for (candidate, c) in plant.candidates().iter().enumerate() {
            for start in &c.starts {
                for share in [1.0, 1e-3] {
                    // On the way from where the cause does nothing.
                    let x = start.iter().zip(&c.parameters).map(|(x, p)| p.off.map_or(*x, |off| off + share * (x - off)));
                    let model = Model::new(vec![Term { candidate, x: x.collect() }], 4.0, true);
                    let Ok(predicted) = plant.predict(&model, 0, &nuisance(&plant)) else {
                        // What cannot be simulated is not adopted.
                        refused.push(c.id);
                        continue;
                    };
                    let found =
                        apart(folder.path(), &dataset, &plant, &model).unwrap_or_else(|error| panic!("{}: {error}", c.id));
                    assert!(found < SAME, "{mount}, {} {:?}: {found} mm", c.id, model.terms[0].x);
                    moved += usize::from(predicted.iter().zip(&plain).any(|(a, b)| (a - b).abs() > 1e-3));
                }
            }
        }
        // Limits so far off that no file may hold them, and a contact problem that does not converge.
        assert!(refused.iter().all(|id| ["saturation", "slew-limit", "dry-friction"].contains(id)), "{mount}: {refused:?}");
        assert!(moved > 20, "{mount}: only {moved} models differ from the nominal one");
    }
}

#[test]
fn a_drift_is_another_constant_in_each_run_in_the_order_of_the_data_set() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "clamped", 2, 4);
    let dataset = Dataset::read(&folder.path().join("x.toml")).unwrap();
    let plant = RobotPlant::new(&dataset, &quality::check(&dataset));
    let candidate = |id: &str| plant.candidates().iter().position(|c| c.id == id).unwrap();
    for (drift, constant) in [("gain-drift", "actuation-gain"), ("stiffness-drift", "stiffness")] {
        let of = |id: &str, x: f64, run: usize| {
            let model = Model::new(vec![Term { candidate: candidate(id), x: vec![x] }], 2.0, true);
            plant.predict(&model, run, &nuisance(&plant)).unwrap()
        };
        for (run, from_mean) in [-1.5, -0.5, 0.5, 1.5].into_iter().enumerate() {
            assert_eq!(of(drift, 0.0625, run), of(constant, 1.0 + 0.0625 * from_mean, run), "{drift} {run}");
        }
    }
    // Two runs differ by a drift whatever makes them differ.
    write(folder.path(), "clamped", 2, 2);
    let dataset = Dataset::read(&folder.path().join("x.toml")).unwrap();
    let plant = RobotPlant::new(&dataset, &quality::check(&dataset));
    assert!(plant.candidates().iter().all(|c| !c.id.ends_with("-drift")));
}

#[test]
fn a_free_form_is_written_with_lists() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "clamped", 3, 1);
    let dataset = Dataset::read(&folder.path().join("x.toml")).unwrap();
    let plant = RobotPlant::new(&dataset, &quality::check(&dataset));
    for (id, key, weights) in [
        ("free-moment-of-rate", "moment_mn_m", vec![0.1, 0.2, 0.3, 0.4, 0.5]),
        ("free-joint-friction", "moment_mn_m", vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6]),
        ("free-clamp", "compliance_rad_per_n_m", vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.002]),
    ] {
        let candidate = plant.candidates().iter().position(|c| c.id == id).unwrap();
        let model = Model::new(vec![Term { candidate, x: weights.clone() }], 3.0, true);
        let (toml, _) = extended::experiment(&dataset, &plant, &model, 0, &nuisance(&plant).shares);
        let table: toml::Table = toml::from_str(&toml).unwrap();
        let effect = &table["effect"].as_array().unwrap()[0];
        let list: Vec<f64> = effect[key].as_array().unwrap().iter().map(|x| x.as_float().unwrap()).collect();
        assert_eq!(list, weights[..list.len()], "{toml}");
        assert!(list.len() > 3 && !toml.contains("_1_"), "{toml}");
    }
}

/// Diagnoses the single run of [`write`] and compares the file's recording with the column of residuals.csv.
fn as_a_user_does(mount: &str) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), mount, 2, 1);
    let done = |args: &[&str]| {
        let output = sfers(folder.path(), args);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    done(&["diagnose", "x.toml", "--out", "d", "--quiet"]);
    done(&["run", "d/extended.toml", "--out", "run.csv", "--quiet"]);
    let mut run = csv::Reader::from_path(folder.path().join("run.csv")).unwrap();
    let heads = run.headers().unwrap().clone();
    // The tip is the last node.
    let last = heads.iter().filter(|head| head.starts_with("node") && head.ends_with("_z_mm")).count() - 1;
    let column = |name: &str| heads.iter().position(|head| head == name).unwrap();
    let (time, z) = (column("t_s"), column(&format!("node{last}_z_mm")));
    let rows: Vec<csv::StringRecord> = run.records().map(Result::unwrap).collect();
    let recorded = |t: f64| rows.iter().find(|row| (row[time].parse::<f64>().unwrap() - t).abs() < 1e-9).unwrap();
    let mut residuals = csv::Reader::from_path(folder.path().join("d/residuals.csv")).unwrap();
    let (mut worst, mut count) = (0.0_f64, 0);
    for row in residuals.records().map(Result::unwrap).filter(|row| &row[2] == "tip_z" && &row[8] == "1") {
        let (t, extended) = (row[3].parse::<f64>().unwrap(), row[7].parse::<f64>().unwrap());
        worst = worst.max((recorded(t)[z].parse::<f64>().unwrap() - extended).abs());
        count += 1;
    }
    assert!(count > 30, "{count}");
    worst
}

#[test]
fn the_written_file_gives_the_column_of_the_residuals_clamped_and_on_the_floor() {
    for mount in ["clamped", "ground"] {
        let worst = as_a_user_does(mount);
        assert!(worst < SAME, "{mount}: {worst} mm");
    }
}
