//! `sfers diagnose` as a user types it: the samples, what it writes, and bad data.

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use common::sfers;
use serde_json::Value;

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/datasets").join(name).join("dataset.toml")
}

/// Diagnoses a sample into a folder and returns its diagnosis.
fn diagnosed(folder: &Path, name: &str) -> Value {
    let output = sfers(folder, &["diagnose", sample(name).to_str().unwrap(), "--out", "d", "--quiet"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_str(&fs::read_to_string(folder.join("d/diagnosis.json")).unwrap()).unwrap()
}

fn ids(diagnosis: &Value) -> Vec<&str> {
    let effects = diagnosis["effects"].as_array().unwrap();
    effects.iter().map(|effect| effect["id"].as_str().unwrap()).filter(|id| *id != "discretisation").collect()
}

#[test]
fn the_sample_with_a_tip_mass_is_named_and_leaves_what_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let d = diagnosed(folder.path(), "sample-tip-mass");
    assert_eq!((d["schema"].as_u64(), d["verdict"].as_str(), ids(&d)), (Some(1), Some("named"), vec!["tip-mass"]));
    // The noise is 0.05 mm. Seen: 0.0503.
    assert!(d["extended"]["rmse_heldout_mm"].as_f64().unwrap() < 1.2 * 0.05);
    assert!(d["baseline"]["rmse_heldout_mm"].as_f64().unwrap() > 0.3);
    // The extended model is an experiment, and its run ends where the data's does.
    let output = sfers(&folder.path().join("d"), &["run", "extended.toml", "--out", "run.csv"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = fs::read_to_string(folder.path().join("d/extended.toml")).unwrap();
    assert!(text.contains("id = \"tip-mass\"") && text.contains("motors_per_actuator = 10"));
    let mut residuals = csv::Reader::from_path(folder.path().join("d/residuals.csv")).unwrap();
    let rows: Vec<csv::StringRecord> = residuals.records().map(Result::unwrap).collect();
    let number = |row: &csv::StringRecord, at: usize| row[at].parse::<f64>().ok();
    let squares: Vec<f64> = rows.iter().filter_map(|row| Some((number(row, 4)? - number(row, 7)?).powi(2))).collect();
    let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    assert!((rms / d["extended"]["rmse_mm"].as_f64().unwrap() - 1.0).abs() < 1e-3, "{rms}");
    // One page with its figures, and no reference to anything outside.
    let page = fs::read_to_string(folder.path().join("d/report.html")).unwrap();
    assert_eq!(page.matches("<svg").count(), 12);
    assert!(!page.contains("http://") || page.matches("http://").count() == page.matches("http://www.w3.org").count());
    let at = |words: &str| page.find(words).unwrap_or_else(|| panic!("{words}"));
    let order = [
        "class=\"verdict\"",
        "The gain",
        "Measured and simulated",
        "Residuals",
        "Candidates",
        "Parameters",
        "Tests of",
        "Data quality",
        "measure next",
        "reproduce",
    ];
    assert!(order.windows(2).all(|pair| at(pair[0]) < at(pair[1])));
}

#[test]
fn the_samples_with_hysteresis_and_with_nothing_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let d = diagnosed(folder.path(), "sample-hysteresis");
    assert_eq!((d["verdict"].as_str(), ids(&d)), (Some("named"), vec!["hysteresis"]));
    assert!(d["extended"]["rmse_heldout_mm"].as_f64().unwrap() < 1.2 * 0.05);
    let d = diagnosed(folder.path(), "sample-nothing-hidden");
    assert_eq!((d["verdict"].as_str(), ids(&d)), (Some("none"), vec![]));
    let required = sfers(
        folder.path(),
        // A folder stands for the description in it.
        &["diagnose", sample("sample-nothing-hidden").parent().unwrap().to_str().unwrap(), "--out", "e", "--require", "--quiet"],
    );
    assert_eq!(required.status.code(), Some(1));
}

#[test]
fn the_report_opens_in_a_browser_without_a_complaint() {
    let folder = tempfile::tempdir().unwrap();
    diagnosed(folder.path(), "sample-nothing-hidden");
    let page = folder.path().join("d/report.html");
    let output = Command::new("chromium")
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--dump-dom"])
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .arg(format!("file://{}", page.display()))
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let (dom, log) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(dom.matches("<svg").count() == 12 && dom.contains("Nothing missing"), "{dom}");
    assert!(!log.contains("CONSOLE"), "{log}");
}

const HEAD: &str = "[dataset]\nname = \"x\"\n[robot]\nactuators = 1\nmount = \"clamped\"\n[markers]\ntip = 100.0\n";
const RUN: &str = "[[run]]\nid = \"a\"\nfile = \"a.csv\"\n";

#[test]
fn bad_data_are_refused_with_file_line_and_column() {
    let folder = tempfile::tempdir().unwrap();
    let good = "t_s,v1_v,tip_z_mm\n0,0,1\n0.1,0,1\n";
    for (toml, csv, code, words) in [
        (HEAD.to_owned(), good, 3, vec!["x.toml", "no runs"]),
        (format!("{HEAD}{RUN}"), "", 3, vec!["a.csv", "empty"]),
        (format!("{HEAD}{RUN}"), "t_s,v1_v,nose_z_mm\n0,0,1\n", 3, vec!["a.csv, line 1, column 3", "nose_z_mm"]),
        (format!("{HEAD}{RUN}"), "t_s,v1_v,tip_z_mm\n0,0,1\n0,0,1\n", 3, vec!["a.csv, line 3, column 1", "rise"]),
        (format!("{HEAD}{RUN}"), "t_s,v1_v,tip_z_mm\n0,0,\n1,0,\n", 3, vec!["a.csv", "all values"]),
        (format!("{HEAD}{RUN}"), "t_s,tip_z_mm\n0,1\n", 3, vec!["a.csv, line 1", "v1_v"]),
        (format!("{HEAD}{RUN}"), "t_s,v1_v,v2_v,tip_z_mm\n0,0,0,1\n", 3, vec!["a.csv, line 1, column 3", "another robot"]),
        (format!("{HEAD}{RUN}"), "t_s,v1_v,tip_z_mm\n0,0,one\n", 3, vec!["a.csv, line 2, column 3", "one"]),
        (format!("{HEAD}{RUN}{RUN}"), good, 3, vec!["x.toml", "two runs"]),
        (format!("{HEAD}legs = 4\n{RUN}").replace("tip = 100.0", "tip = 300.0"), good, 3, vec!["300"]),
        (format!("{HEAD}{RUN}speed = 3\n"), good, 2, vec!["x.toml", "line 11", "speed"]),
    ] {
        fs::write(folder.path().join("x.toml"), &toml).unwrap();
        fs::write(folder.path().join("a.csv"), csv).unwrap();
        let output = sfers(folder.path(), &["diagnose", "x.toml", "--out", "d"]);
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{toml}{csv}: {text}");
        assert!(words.iter().all(|word| text.contains(word)), "{words:?} in {text}");
        assert!(!folder.path().join("d").exists(), "{toml}");
    }
}

#[test]
fn one_run_is_too_little_to_decide_and_the_diagnosis_says_so() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("x.toml"), format!("{HEAD}{RUN}")).unwrap();
    let rows: String = (0..100).map(|i| format!("{},{},{}\n", 0.01 * f64::from(i), -5 * i, -0.3 * f64::from(i))).collect();
    fs::write(folder.path().join("a.csv"), format!("t_s,v1_v,tip_z_mm\n{rows}")).unwrap();
    let output = sfers(folder.path(), &["diagnose", "x.toml", "--out", "d", "--quiet", "--json"]);
    let d: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((d["verdict"].as_str(), ids(&d)), (Some("unexplained"), vec![]));
    assert!(d["summary"].as_str().unwrap().contains("too little"), "{}", d["summary"]);
}

#[test]
fn the_published_numbers_are_tied_between_causes() {
    let folder = tempfile::tempdir().unwrap();
    let output = sfers(folder.path(), &["diagnose", "preset:published-cantilever", "--out", "d", "--quiet", "--json"]);
    let d: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(d["verdict"].as_str(), Some("tied"));
    let named: Vec<String> = d["effects"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|effect| std::iter::once(&effect["id"]).chain(effect["tied_with"].as_array().unwrap()))
        .map(|id| id.as_str().unwrap().to_owned())
        .collect();
    // A stiffer or a lighter sheet would do; a stronger actuator alone cannot raise a resonance.
    assert!(["stiffness", "areal-mass"].iter().all(|id| named.iter().any(|name| name == id)), "{named:?}");
    assert!(!named.iter().any(|name| name == "actuation-gain"), "{named:?}");
    assert!(d["next_experiment"].is_string());
}

#[test]
fn effects_are_listed_with_their_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let text = String::from_utf8(sfers(folder.path(), &["effects"]).stdout).unwrap();
    assert!(text.contains("hysteresis (actuation)") && text.contains("mass_g (g)"));
    let json: Value = serde_json::from_slice(&sfers(folder.path(), &["effects", "--json"]).stdout).unwrap();
    assert_eq!(json["effects"].as_array().unwrap().len(), 30);
}
