//! The paper's curve of speed against frequency, from the constants of the preset `published-speeds`, and ensembles in sweeps.

mod common;

use std::collections::BTreeMap;
use std::fs;

use common::sfers;

/// Mean speeds (mm/s) by joints per actuator and time step, from 1 Hz on.
fn curves(text: &str) -> BTreeMap<(String, String), Vec<f64>> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().unwrap().clone();
    let column = |name: &str| header.iter().position(|other| other == name).unwrap();
    let (motors, step) = (column("robot.motors_per_actuator"), column("simulation.time_step_s"));
    let (mean, status) = (column("mean_speed_mm_s"), column("status"));
    let mut curves: BTreeMap<_, Vec<f64>> = BTreeMap::new();
    for row in reader.records().map(Result::unwrap) {
        assert_eq!(&row[status], "ok");
        curves.entry((row[motors].to_owned(), row[step].to_owned())).or_default().push(row[mean].parse().unwrap());
    }
    curves
}

/// The constants were chosen with the perturbations of the preset's seed; those here are others.
#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn the_published_signs_and_places_come_out_for_two_chains_at_two_steps() {
    let folder = tempfile::tempdir().unwrap();
    let output =
        sfers(folder.path(), &["sweep", "preset:published-speeds-scan", "--out", "s", "--quiet", "--set", "ensemble.seed=2"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let curves = curves(&fs::read_to_string(folder.path().join("s/results.csv")).unwrap());
    assert_eq!(curves.len(), 4);
    for (of, means) in curves {
        let at = |hz: usize| means[hz - 1];
        let extreme = |sign: f64| (1..=20).max_by(|a, b| (sign * at(*a)).total_cmp(&(sign * at(*b)))).unwrap();
        // At 1 Hz the speed is the travel of a cycle.
        assert!((at(1) / 1.9 - 1.0).abs() < 0.15, "{of:?}: {means:?}");
        assert!((1..=3).all(|hz| at(hz) > 0.0), "{of:?}: {means:?}");
        assert!((6..=9).contains(&extreme(-1.0)) && at(extreme(-1.0)) < 0.0, "{of:?}: {means:?}");
        assert!((13..=17).contains(&extreme(1.0)) && at(extreme(1.0)) > 0.0, "{of:?}: {means:?}");
    }
}

#[test]
fn an_ensemble_has_the_same_bytes_on_any_number_of_threads_and_a_band_in_its_figure() {
    let folder = tempfile::tempdir().unwrap();
    let sweep = "experiment = \"preset:jump-14hz\"\nmeasures = [\"jump_height_mm\", \"speed_mm_s\"]\n[vary]\n\
                 \"drive.frequency_hz\" = [10, 12, 14]\n[ensemble]\nmembers = 5\nseed = 2\n[ensemble.vary]\n\
                 \"robot.damping_eta\" = { relative = 0.05 }\n\"simulation.joint_angles_rad\" = { sd = 1e-3 }\n";
    fs::write(folder.path().join("s.toml"), sweep).unwrap();
    let short = ["--set", "simulation.time_step_s=1e-4", "--quiet"];
    let results = ["1", "2"].map(|jobs| {
        let output = sfers(folder.path(), &[&["sweep", "s.toml", "--out", jobs, "--jobs", jobs], &short[..]].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        fs::read_to_string(folder.path().join(jobs).join("results.csv")).unwrap()
    });
    assert_eq!(results[0], results[1]);
    let header = results[0].lines().next().unwrap();
    assert_eq!(
        header,
        "drive.frequency_hz,mean_jump_height_mm,sd_jump_height_mm,q05_jump_height_mm,q50_jump_height_mm,q95_jump_height_mm,\
         mean_speed_mm_s,sd_speed_mm_s,q05_speed_mm_s,q50_speed_mm_s,q95_speed_mm_s,status"
    );
    let row: Vec<f64> = results[0].lines().nth(3).unwrap().split(',').take(6).map(|cell| cell.parse().unwrap()).collect();
    assert!(row[3] <= row[4] && row[4] <= row[5] && row[2] > 0.0 && (row[3]..=row[5]).contains(&row[1]), "{row:?}");
    let plot = sfers(folder.path(), &["plot", "1/results.csv", "--out", "s.svg"]);
    assert!(plot.status.success(), "{}", String::from_utf8_lossy(&plot.stderr));
    let svg = fs::read_to_string(folder.path().join("s.svg")).unwrap();
    assert!(svg.matches("<polygon").count() >= 1 && svg.contains("mean jump height"), "{svg}");
}

#[test]
fn sfers_run_prints_the_spread_of_an_ensemble_and_keeps_its_members() {
    let folder = tempfile::tempdir().unwrap();
    let text = "[drive]\nwaveform = \"gait\"\ngait = \"crawl\"\nfrequency_hz = 14\n[simulation]\nengine = \"planar\"\ntime_step_s = 1e-4\nduration_s = 0.5\n\
                [ensemble]\nmembers = 4\n[ensemble.vary]\n\"robot.friction.low\" = { relative = 0.05 }\n";
    fs::write(folder.path().join("e.toml"), text).unwrap();
    let run = |arguments: &[&str]| sfers(folder.path(), &[&["run", "e.toml", "--quiet"], arguments].concat());
    let output = run(&["--out", "m.csv"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(printed.lines().any(|line| line.starts_with("jump_height_mm = ") && line.contains("5 to 95 %")), "{printed}");
    let members = fs::read_to_string(folder.path().join("m.csv")).unwrap();
    assert!(members.lines().count() == 5 && members.starts_with("member,jump_height_mm"), "{members}");
    let json: serde_json::Value = serde_json::from_slice(&run(&["--json"]).stdout).unwrap();
    assert_eq!(json["members"], 4);
    assert!(json["ensemble"]["jump_height_mm"]["sd"].as_f64().unwrap() > 0.0, "{json}");
    for (arguments, word) in [(&["--out", "m.npz"][..], "FILE.csv"), (&["--save-state", "s"][..], "[ensemble]")] {
        let refused = run(arguments);
        assert_eq!(refused.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&refused.stderr).contains(word));
    }
}
