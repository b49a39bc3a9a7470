//! `sfers diagnose` as a user types it: the samples, what it writes, and bad data.

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use common::{pages, sfers, tools};
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

/// The named causes, without minor ones.
fn ids(diagnosis: &Value) -> Vec<&str> {
    let effects = diagnosis["effects"].as_array().unwrap();
    effects
        .iter()
        .filter(|effect| effect["role"] == "cause")
        .map(|effect| effect["id"].as_str().unwrap())
        .filter(|id| *id != "discretisation")
        .collect()
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn the_sample_with_a_tip_mass_is_named_and_leaves_what_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let d = diagnosed(folder.path(), "sample-tip-mass");
    assert_eq!((d["schema"].as_u64(), d["verdict"].as_str(), ids(&d)), (Some(2), Some("named"), vec!["tip-mass"]));
    // The noise is 0.05 mm. Seen: 0.0503.
    assert!(d["extended"]["rmse_heldout_mm"].as_f64().unwrap() < 1.2 * 0.05);
    assert!(d["baseline"]["rmse_heldout_mm"].as_f64().unwrap() > 0.3);
    // A new run is expected within 1.96 σ of the model, which misses nothing else to speak of; as is each of those that judge. Seen: 0.0992 mm.
    let expected = &d["prediction"];
    let half = expected["half_width_mm"].as_f64().unwrap();
    assert!((1.9 * 0.05..2.4 * 0.05).contains(&half) && expected["discrepancy_mm"].as_f64().unwrap() < 0.5 * 0.05, "{expected}");
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
    assert_eq!(page.matches("<figure").count(), 13);
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
    check_report(&page, &d, &text);
}

/// Parses a report and holds it against its diagnosis.json and extended.toml.
fn check_report(page: &str, d: &Value, extended: &str) {
    let document = roxmltree::Document::parse(pages::markup(page)).unwrap();
    pages::check_self_contained(&document);
    assert_eq!(pages::wrong_numbers(&document), Vec::<String>::new());
    assert_eq!(pages::texts(&document, "pre").concat(), extended.trim_end());

    // The first sentence names the tests that fail, if more do than chance explains: three of 80 would in one case of 10,000.
    assert!(page.contains("of a new run like the") && d["prediction"]["runs"].as_u64().unwrap() >= 2);
    let tests = d["extended"]["residual_tests"].as_array().unwrap();
    let failed: Vec<&str> = tests.iter().filter(|t| t["passed"] == false).map(|t| t["name"].as_str().unwrap()).collect();
    let verdict = document.descendants().find(|n| pages::has_class(n, "verdict")).map(pages::text).unwrap();
    let sentence = verdict.split(". ").nth(1).unwrap();
    if failed.len() >= 3 {
        assert!(sentence.contains(&format!("{} of {} residual tests still fail", failed.len(), tests.len())), "{verdict}");
        assert!(failed.iter().all(|name| sentence.contains(name)), "{verdict}");
    } else if failed.is_empty() {
        assert!(!verdict.contains("fail"), "{verdict}");
    }

    // Every test of every model is a square of one picture; those that fail are crossed.
    let stages = ["baseline", "calibrated", "extended"].map(|stage| d[stage]["residual_tests"].as_array().unwrap());
    let squares = |class: &str| {
        document
            .descendants()
            .filter(|n| n.has_tag_name(("http://www.w3.org/2000/svg", "g")) && pages::has_class(n, class))
            .count()
    };
    let count = |passed: bool| stages.iter().flat_map(|tests| tests.iter()).filter(|t| t["passed"] == passed).count();
    assert_eq!((squares("passed"), squares("failed")), (count(true), count(false)));

    // Constants have names and units, no ids.
    let rows: Vec<Vec<String>> = document
        .descendants()
        .filter(|n| n.has_tag_name("tr"))
        .map(|row| row.children().filter(|n| n.has_tag_name("td")).map(pages::text).collect())
        .collect();
    let tuned: Vec<&Vec<String>> = rows.iter().filter(|row| row.len() == 5 && row[4].contains("× the nominal")).collect();
    assert_eq!(tuned.len(), d["calibrated"]["parameters"].as_array().unwrap().len());
    let known =
        [("bending stiffness", "N·mm²"), ("curvature per volt", "1/(m·kV)"), ("damping time", "ms"), ("mass per area", "kg/m²")];
    assert!(tuned.iter().all(|row| known.contains(&(row[0].as_str(), row[3].as_str()))), "{tuned:?}");
    assert!(rows.iter().flatten().all(|cell| cell != "scale" && !cell.contains("mass_g")), "{rows:?}");
    let found: Vec<&Vec<String>> = rows.iter().filter(|row| row.len() == 6 && row[3].contains(" to ")).collect();
    let fitted: usize = d["effects"].as_array().unwrap().iter().map(|e| e["parameters"].as_array().unwrap().len()).sum();
    assert_eq!(found.iter().filter(|row| !row[4].is_empty()).count(), fitted, "{rows:?}");

    // Forms of one cause are told apart.
    let candidates = d["candidates"].as_array().unwrap();
    let mut labels: Vec<&String> = rows.iter().filter(|row| row.len() == 3).map(|row| &row[0]).collect();
    assert_eq!(labels.len(), candidates.len().min(12));
    labels.sort();
    labels.dedup();
    assert_eq!(labels.len(), candidates.len().min(12), "{labels:?}");
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn the_samples_with_hysteresis_and_with_nothing_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let d = diagnosed(folder.path(), "sample-hysteresis");
    assert_eq!((d["verdict"].as_str(), ids(&d)), (Some("named"), vec!["hysteresis"]));
    // What slope of the loop is called its gain is a convention.
    assert!(d["effects"].as_array().unwrap().iter().any(|e| e["id"] == "actuation-gain" && e["role"] == "minor"));
    let read = |name: &str| fs::read_to_string(folder.path().join("d").join(name)).unwrap();
    check_report(&read("report.html"), &d, &read("extended.toml"));
    let summary = d["summary"].as_str().unwrap();
    assert!(
        summary.starts_with("The simulation lacks: hysteresis, plays") && summary.contains("opening of the loop"),
        "{summary}"
    );
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
#[ignore = "slow: run by scripts/test.sh"]
fn the_report_opens_in_a_browser_without_a_complaint() {
    let Some(mut chromium) = tools::chromium("the_report_opens_in_a_browser_without_a_complaint") else { return };
    let folder = tempfile::tempdir().unwrap();
    diagnosed(folder.path(), "sample-nothing-hidden");
    let page = folder.path().join("d/report.html");
    let output = chromium
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--dump-dom"])
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .arg(format!("file://{}", page.display()))
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let (dom, log) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(dom.matches("<figure").count() == 13 && dom.contains("class=\"verdict\"><strong>Nothing "), "{dom}");
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
        (format!("{HEAD}{RUN}"), "t_s,v1_v,tip_z_mm\n0,0,1\n", 3, vec!["a.csv, line 2", "one row"]),
        (
            format!("{HEAD}{RUN}"),
            "t_s,v1_v,tip_z_mm\n0,0,1\n0.1,-2e5,1\n",
            3,
            vec!["a.csv, line 3, column 2", "v1_v", "beyond 10000 V"],
        ),
        (format!("{HEAD}{RUN}"), "t_s,v1_v,tip_z_mm\n0,0,1\n0.1,0,1e300\n", 3, vec!["a.csv, line 3, column 3", "mm"]),
        (format!("{HEAD}{RUN}"), "t_s,v1_v,tip_z_mm\n0,0,1\ninf,0,1\n", 3, vec!["a.csv, line 3, column 1", "inf"]),
        (format!("{HEAD}{RUN}"), "t_s,v1_v,tip_z_mm\n0,0,1\n0.1,nan,1\n", 3, vec!["a.csv, line 3, column 2", "nan"]),
        (format!("{HEAD}{RUN}"), "t_s,v1_v,tip_z_mm\n0,0,1\n1e-12,0,1\n", 3, vec!["a.csv, line 3, column 1", "rise"]),
        (format!("{HEAD}{RUN}"), "t_s,v1_v,tip_z_mm\n0,0,1\n1e6,0,1\n2e6,0,2\n", 3, vec!["a.csv", "run a", "in seconds"]),
        (format!("{HEAD}{RUN}"), "t_s,v1_v,tip_z_mm\n", 3, vec!["a.csv, line 1", "no rows"]),
        (format!("{HEAD}{RUN}").replace("a.csv", "."), good, 3, vec!["directory"]),
        (format!("{HEAD}{RUN}").replace("a.csv", "b.csv"), good, 3, vec!["b.csv"]),
        (format!("{HEAD}{RUN}").replace("\"a\"", "\" \""), good, 3, vec!["x.toml, line 9", "id is empty"]),
        (format!("{HEAD}[noise]\ndefault_mm = -0.1\n{RUN}"), good, 3, vec!["x.toml, line 9", "default_mm", "-0.1"]),
        (format!("{HEAD}[noise]\ntip_mm = nan\n{RUN}"), good, 3, vec!["x.toml, line 9", "tip_mm"]),
        (format!("{HEAD}[bench]\nclock_ms = -4\n{RUN}"), good, 2, vec!["x.toml, line 9", "bench.clock_ms", "-4", "estimated"]),
        (format!("{HEAD}[bench]\ngain = nan\n{RUN}"), good, 2, vec!["x.toml, line 9", "bench.gain", "NaN"]),
        (format!("{HEAD}[bench]\ngain_percent = 1\n{RUN}"), good, 2, vec!["x.toml", "line 9", "gain_percent"]),
        (format!("{HEAD}{RUN}").replace("tip = 100.0", "tip = -1.0"), good, 3, vec!["x.toml, line 7", "-1"]),
        (format!("{HEAD}{RUN}").replace("tip = 100.0", "tip = nan"), good, 3, vec!["x.toml, line 7", "NaN"]),
        (format!("{HEAD}{RUN}").replace("actuators = 1", "actuators = 4000000000"), good, 2, vec!["x.toml, line 4", "actuators"]),
        (format!("{HEAD}{RUN}").replace("actuators = 1", "actuators = 0"), good, 2, vec!["x.toml, line 4", "actuators"]),
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
fn files_shapes_and_robots_of_a_run_are_checked_and_named_with_their_lines() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("a.csv", "t_s,tip_z_mm\n0,1\n0.1,1\n0.2,2\n");
    write("v.csv", "t_s,v1_v\n5,0\n6,0\n");
    write("w.csv", "t_s,v1_v,tip_z_mm\n0,0,1\n1,0,1\n");
    let released = |keys: &str| format!("{HEAD}{RUN}start = \"released\"\n[run.release]\n{keys}\n");
    // The run's table is line 8, its further keys line 11 and on.
    for (toml, code, words) in [
        (format!("{HEAD}{RUN}"), 3, vec!["a.csv, line 1", "v1_v is missing", "voltage_file"]),
        (
            format!("{HEAD}{RUN}voltage_file = \"v.csv\"\n"),
            3,
            vec!["x.toml, line 11: run a: voltage_file", "a.csv", "does not overlap", "from 0 to 0.2", "from 5 to 6", "v.csv"],
        ),
        (format!("{HEAD}{RUN}voltage_file = \"w.csv\"\n"), 3, vec!["w.csv, line 1, column 3", "tip_z_mm"]),
        (
            format!("{HEAD}{RUN}voltage_file = \"v.csv\"\n").replace("a.csv", "w.csv"),
            3,
            vec!["w.csv, line 1, column 2", "voltage_file"],
        ),
        (format!("{HEAD}{RUN}voltage_file = \"x.csv\"\n"), 3, vec!["x.csv"]),
        (format!("{HEAD}{RUN}start = \"released\"\n"), 2, vec!["line 11", "without a shape", "hung_g", "level", "held"]),
        (format!("{HEAD}{RUN}start = \"let go\"\n"), 2, vec!["line 11", "start", "released"]),
        (format!("{HEAD}{RUN}[run.release]\nlevel = true\n"), 2, vec!["line 11", "start = \"released\""]),
        (released("at_s = 0.1"), 2, vec!["line 12", "no shape"]),
        (released("level = false"), 2, vec!["line 12", "no shape"]),
        (released("level = true\nhung_g = 1"), 2, vec!["line 12", "more than one"]),
        (released("hung_g = -1"), 2, vec!["line 13", "hung_g", "-1"]),
        (released("held = \"nose\"\nheld_z_mm = 3"), 2, vec!["line 13", "nose", "tip"]),
        (released("held = \"tip\"\nheld_z_mm = 99"), 2, vec!["line 14", "held_z_mm", "99"]),
        (released("level = true\nheight_mm = 5"), 2, vec!["line 14", "height_mm", "mount = \"ground\""]),
        (
            released("level = true\nheight_mm = -5").replace("clamped", "ground"),
            2,
            vec!["line 14", "height_mm", "-5", "from 0 to 1000"],
        ),
        (released("level = true\nat_s = 7"), 2, vec!["line 14", "at_s", "from 0 to 0.2"]),
        (released("level = true\nfrom = 7"), 2, vec!["line 14", "from"]),
        (released("level = true\n[run.robot]\nactuators = 2"), 2, vec!["line 15", "actuators", "a file of its own"]),
        (released("level = true\n[run.material]\nactuator_length_mm = 50"), 2, vec!["100 mm", "50 mm long", "[run.markers]"]),
        (released("level = true\n[run.material]\nactuator_length_mm = -5"), 2, vec!["line 15", "actuator_length_mm", "-5"]),
        (released("level = true\n[run.markers]\nnose = 5"), 2, vec!["line 15", "nose"]),
        (released("level = true\n[[run.effect]]\nid = \"hysteresis\""), 2, vec!["line 14", "structure", "tip-mass"]),
        (released("level = true\n[[run.effect]]\nid = \"tip-mass\"\nmass_g = -1"), 2, vec!["line 14", "mass_g", "-1"]),
        (format!("[[effect]]\nid = \"creep\"\n{}", released("level = true")), 2, vec!["line 1", "creep", "structure"]),
        (format!("[columns]\ntip_y_mm = {{ from = \"y\" }}\n{}", released("level = true")), 2, vec!["line 2", "tip_y_mm"]),
        (format!("[columns]\nt_s = {{ from = \"t\", factor = 0 }}\n{}", released("level = true")), 2, vec!["line 2", "factor"]),
    ] {
        write("x.toml", &toml);
        let output = sfers(folder.path(), &["diagnose", "x.toml", "--out", "d"]);
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{toml}: {text}");
        assert!(words.iter().all(|word| text.contains(word)), "{words:?} in {text}\n{toml}");
        assert!(!folder.path().join("d").exists(), "{toml}");
    }
}

#[test]
fn frames_loops_responses_and_equilibria_are_checked_and_named_with_their_lines() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("a.csv", "v1_v,tip_z_mm\n0,1\n10,1\n10,2\n");
    write("frames.csv", "frame,v1_v,tip_z_mm\n0,0,1\n1,0,1\n");
    let response =
        "[[frequency_response]]\nid = \"r\"\nfile = \"r.csv\"\ncoordinate = \"tip_z\"\namplitude_v = 10\nsigma_mm = 0.1\n";
    let steady = "[[steady]]\nvoltages_v = [-100]\ntip_z_mm = 1\n";
    let good = "f_hz,amplitude_mm,phase_deg\n1,0.1,0\n2,0.1,0\n";
    for (toml, csv, code, words) in [
        (format!("{HEAD}{RUN}"), good, 3, vec!["a.csv, line 1", "t_s is missing", "rate_v_per_s"]),
        (format!("{HEAD}{RUN}rate_v_per_s = 5\n"), good, 3, vec!["a.csv, line 4", "row before", "keep one"]),
        (format!("{HEAD}{RUN}rate_v_per_s = -5\n"), good, 2, vec!["line 11", "rate_v_per_s", "-5"]),
        (
            format!("{HEAD}{RUN}rate_v_per_s = 5\n").replace("a.csv", "frames.csv"),
            good,
            3,
            vec!["frames.csv, line 1, column 1", "rate_v_per_s"],
        ),
        (format!("{HEAD}{RUN}").replace("a.csv", "frames.csv"), good, 3, vec!["line 1, column 1", "frame_rate_hz"]),
        (format!("{HEAD}[camera]\nframe_rate_hz = 0\n{RUN}"), good, 2, vec!["line 9", "frame_rate_hz", "above 0"]),
        (
            format!("{HEAD}[camera]\nframe_rate_hz = 100\nexposure_ms = 11\n{RUN}"),
            good,
            2,
            vec!["line 10", "exposure_ms", "10, the time between"],
        ),
        (format!("{HEAD}{response}"), "f_hz,amplitude_mm,phase\n", 3, vec!["r.csv, line 1, column 3", "phase_deg or phase_rad"]),
        (format!("{HEAD}{response}"), "f_hz,amplitude_mm\n1,1\n", 3, vec!["r.csv, line 1", "phase_deg"]),
        (format!("{HEAD}{response}"), "f_hz,amplitude_mm,phase_deg\n2,1,1\n1,1,1\n", 3, vec!["r.csv, line 3, column 1", "rise"]),
        (format!("{HEAD}{response}"), "f_hz,amplitude_mm,phase_deg\n1,-1,0\n", 3, vec!["r.csv, line 2, column 2", "-1"]),
        (format!("{HEAD}{response}"), "f_hz,amplitude_mm,phase_deg\n1,x,0\n", 3, vec!["r.csv, line 2, column 2", "\"x\""]),
        (format!("{HEAD}{response}"), "f_hz,amplitude_mm,phase_deg\n", 3, vec!["r.csv, line 1", "no rows"]),
        (format!("{HEAD}{response}{response}"), good, 3, vec!["two runs"]),
        (format!("{HEAD}{response}").replace("tip_z", "tip_y"), good, 2, vec!["line 11", "coordinate", "tip_y", "tip_z"]),
        (format!("{HEAD}{response}").replace("_v = 10", "_v = -10"), good, 2, vec!["line 12", "amplitude_v", "-10"]),
        (format!("{HEAD}{response}").replace("_v = 10", "_v = 9000"), good, 2, vec!["line 12", "amplitude_v", "9000 V"]),
        (format!("{HEAD}{response}").replace("clamped", "free"), good, 2, vec!["clamped"]),
        (format!("{HEAD}{steady}").replace("[-100]", "[-100, 0]"), good, 2, vec!["line 9", "voltages_v", "2 values for 1"]),
        (format!("{HEAD}{steady}").replace("tip_z_mm", "tip_z"), good, 2, vec!["line 10", "tip_z", "tip_z_mm"]),
        (format!("{HEAD}{steady}").replace("tip_z_mm = 1\n", ""), good, 2, vec!["line 9", "without a position", "tip_z_mm"]),
        (format!("{HEAD}{steady}sigma_mm = 0\n"), good, 2, vec!["line 11", "sigma_mm"]),
    ] {
        write("x.toml", &toml);
        write("r.csv", csv);
        let output = sfers(folder.path(), &["diagnose", "x.toml", "--out", "d"]);
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{toml}{csv}: {text}");
        assert!(words.iter().all(|word| text.contains(word)), "{words:?} in {text}\n{toml}");
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
    // The page has every number beside the models, in its unit, and the constants that would reach them in theirs.
    let page = fs::read_to_string(folder.path().join("d/report.html")).unwrap();
    let document = roxmltree::Document::parse(pages::markup(&page)).unwrap();
    pages::check_self_contained(&document);
    assert_eq!(pages::wrong_numbers(&document), Vec::<String>::new());
    assert!(document.descendants().any(|n| pages::has_class(&n, "verdict")));
    let cells = pages::texts(&document, "td");
    let has = |row: &[&str]| cells.windows(row.len()).any(|cells| cells == row);
    assert!(has(&["tip deflection (mm)", "constant voltage, −1000\u{a0}V", "−20.00", "0.50"]), "{cells:?}");
    assert!(has(&["resonance (Hz)", "sine, −1500\u{a0}V", "23.00", "0.50"]), "{cells:?}");
    assert!(cells.windows(5).any(|c| c[1] == "mass per area" && c[4] == "kg/m²"), "{cells:?}");
    assert!(!cells.iter().any(|cell| cell.contains("areal-mass") || cell == "scale"), "{cells:?}");
}

#[test]
fn effects_are_listed_with_their_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let text = String::from_utf8(sfers(folder.path(), &["effects"]).stdout).unwrap();
    assert!(text.contains("hysteresis (actuation)") && text.contains("mass_g (g)"));
    let json: Value = serde_json::from_slice(&sfers(folder.path(), &["effects", "--json"]).stdout).unwrap();
    assert_eq!(json["effects"].as_array().unwrap().len(), 52);
}

/// Two runs of a sample with `rows` rows, one of every `step`, and the height of one marker alone.
fn thinned(folder: &Path, name: &str, runs: [&str; 2], step: usize, rows: usize, marker: &str) {
    let at = if marker == "mid" { 50.0 } else { 100.0 };
    let mut toml = format!(
        "[dataset]\nname = \"few\"\n[robot]\nactuators = 1\nmotors_per_actuator = 3\nmount = \"clamped\"\ndamping_eta = 0.008\n[markers]\n\
         {marker} = {at:?}\n[noise]\ndefault_mm = 0.05\n"
    );
    for run in runs {
        let mut all = csv::Reader::from_path(sample(name).with_file_name(format!("{run}.csv"))).unwrap();
        let column = all.headers().unwrap().iter().position(|head| head == format!("{marker}_z_mm")).unwrap();
        let mut few = csv::Writer::from_path(folder.join(format!("{run}.csv"))).unwrap();
        few.write_record(["t_s", "v1_v", &format!("{marker}_z_mm")]).unwrap();
        for row in all.records().map(Result::unwrap).step_by(step).take(rows) {
            few.write_record([&row[0], &row[1], &row[column]]).unwrap();
        }
        toml += &format!("[[run]]\nid = \"{run}\"\nfile = \"{run}.csv\"\n");
    }
    fs::write(folder.join("few.toml"), toml).unwrap();
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn a_cause_whose_range_reaches_where_it_does_nothing_is_not_named() {
    let folder = tempfile::tempdir().unwrap();
    // 400 V at 12 Hz and 18 Hz, seen half way, in one coordinate; the same with every third row, 100 or 120 of them. With 120 to 200 of these the range ends before.
    thinned(folder.path(), "sample-hysteresis", ["ac-12hz-400v", "ac-18hz-400v"], 2, 100, "mid");
    let output = sfers(folder.path(), &["diagnose", "few.toml", "--out", "d", "--quiet", "--json", "--require"]);
    let d: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((output.status.code(), ids(&d)), (Some(1), vec![]), "{}", d["summary"]);
    assert!(d["summary"].as_str().unwrap().contains("insufficient") && d["next_experiment"].is_string(), "{d}");
    // Nor is it in the extended model.
    let text = fs::read_to_string(folder.path().join("d/extended.toml")).unwrap();
    assert!(!text.contains("hysteresis\""), "{text}");
}

#[test]
fn too_little_data_name_nothing_say_what_to_measure_and_fail_what_is_required() {
    let folder = tempfile::tempdir().unwrap();
    thinned(folder.path(), "sample-tip-mass", ["ac-12hz-400v", "ac-18hz-400v"], 3, 39, "tip");
    let output = sfers(folder.path(), &["diagnose", "few.toml", "--out", "d", "--quiet", "--json", "--require"]);
    let d: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((output.status.code(), ids(&d)), (Some(1), vec![]), "{}", d["summary"]);
    assert!(d["summary"].as_str().unwrap().contains("39 values to fit and 39 to judge by are too little"), "{}", d["summary"]);
    assert!(d["next_experiment"].as_str().unwrap().contains("three runs"));
}

#[test]
fn a_voltage_with_too_few_rows_for_its_drive_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("x.toml"), format!("{HEAD}{RUN}")).unwrap();
    let rows: String = (0..90)
        .map(|i| {
            let t = f64::from(i) / 30.0;
            format!("{t},{:.2},{:.3}\n", -500.0 * (1.0 - (36.0 * std::f64::consts::PI * t).cos()), -2.0 - 0.1 * f64::from(i % 5))
        })
        .collect();
    fs::write(folder.path().join("a.csv"), format!("t_s,v1_v,tip_z_mm\n{rows}")).unwrap();
    let output = sfers(folder.path(), &["diagnose", "x.toml", "--out", "d"]);
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{text}");
    assert!(
        ["a.csv", "run a", "v1_v", "30.0 rows per second", "ten times per period"].iter().all(|w| text.contains(w)),
        "{text}"
    );
    assert!(!folder.path().join("d").exists());
}

#[test]
fn a_run_driven_from_a_file_has_no_damping_ratio() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..1000)
        .map(|i| {
            let t = 1e-3 * f64::from(i);
            format!("{t},{}\n", -500.0 * (1.0 - (36.0 * std::f64::consts::PI * t).cos()))
        })
        .collect();
    fs::write(folder.path().join("drive.csv"), format!("t_s,v1_v\n{rows}")).unwrap();
    let toml = "[robot]\nactuators = 1\nmount = \"clamped\"\ndamping_eta = 0.008\n[drive]\nwaveform = \"csv\"\nfile = \"drive.csv\"\n[simulation]\n\
                engine = \"planar\"\ntime_step_s = 1e-4\nduration_s = 1.0\n";
    fs::write(folder.path().join("x.toml"), toml).unwrap();
    let output = sfers(folder.path(), &["run", "x.toml", "--quiet", "--json"]);
    let run: Value = serde_json::from_slice(&output.stdout).unwrap();
    let text = run.to_string();
    assert!(text.contains("tip_amplitude_mm") && !text.contains("damping_ratio") && !text.contains("resonance_hz"), "{text}");
}

#[test]
fn names_with_commas_quotes_and_line_breaks_stay_whole_in_every_file() {
    let folder = tempfile::tempdir().unwrap();
    let run = "[[run]]\nid = 'ID'\nfile = \"a.csv\"\n".replace("'ID'", "\"a, \\\"b\\\"\\nc/../d\"");
    fs::write(folder.path().join("x.toml"), format!("{HEAD}{run}").replace("name = \"x\"", "name = \"x\\ny\"")).unwrap();
    let rows: String = (0..100).map(|i| format!("{},{},{}\n", 0.01 * f64::from(i), -5 * i, -0.3 * f64::from(i))).collect();
    fs::write(folder.path().join("a.csv"), format!("t_s,v1_v,tip_z_mm\n{rows}")).unwrap();
    let output = sfers(folder.path(), &["diagnose", "x.toml", "--out", "d", "--quiet"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut residuals = csv::Reader::from_path(folder.path().join("d/residuals.csv")).unwrap();
    let rows: Vec<csv::StringRecord> = residuals.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 100);
    assert!(rows.iter().all(|row| &row[0] == "a, \"b\"\nc/../d" && &row[2] == "tip_z" && row.len() == 9), "{:?}", rows[0]);
    let output = sfers(folder.path(), &["run", "d/extended.toml", "--quiet"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn every_key_of_an_observation_is_checked_and_named_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let head = "[dataset]\nname = \"x\"\n[robot]\nactuators = 1\nmount = \"clamped\"\n";
    let good = "[[observation]]\nmeasure = \"tip_deflection_mm\"\nvalue = -3.0\nsigma = 0.1\n[observation.drive]\nwaveform = \"dc\"\nvoltages_v = [-300]\n";
    let with = |from: &str, to: &str| format!("{head}{good}{}", good.replace(from, to));
    let marked = HEAD.to_owned() + RUN + good;
    // The second observation's table is line 13.
    for (toml, words) in [
        (marked, vec!["line 11", "observation", "[[run]]"]),
        (with("tip_deflection_mm", "tip_deflexion_mm"), vec!["line 14", "measure", "tip_deflexion_mm", "resonance_hz"]),
        (with("tip_deflection_mm", "jump_height_mm"), vec!["line 14", "jump_height_mm", "clamped"]),
        (with("tip_deflection_mm", "tip_phase_deg"), vec!["line 14", "tip_phase_deg", "period"]),
        (with("tip_deflection_mm", "energy_error"), vec!["line 14", "energy_error"]),
        (with("value = -3.0", "value = nan"), vec!["line 15", "value", "NaN"]),
        (with("sigma = 0.1", "sigma = -0.1"), vec!["line 16", "sigma", "-0.1"]),
        (with("[-300]", "[-300, 0]"), vec!["line 19", "voltages_v", "2 values for 1"]),
        (with("\"dc\"", "\"ac\""), vec!["line 18", "waveform", "ac"]),
        (with("[-300]\n", "[-300]\n[observation.simulation]\ntime_step_s = -1\n"), vec!["line 21", "time_step_s", "-1"]),
        (with("[-300]\n", "[-300]\n[observation.simulation]\nduration_s = 1e7\n"), vec!["simulation", "steps"]),
        (with("[-300]\n", "[-300]\n[observation.material]\nwidth_mm = -4\n"), vec!["line 21", "width", "must be"]),
        (with("[-300]\n", "[-300]\n[observation.robot]\nmotors_per_actuator = 0\n"), vec!["line 21", "motors_per_actuator"]),
        (with("sigma = 0.1\n", ""), vec!["sigma"]),
        (with("sigma = 0.1\n", "sigma = 0.1\nunit = \"mm\"\n"), vec!["line 17", "unit"]),
    ] {
        fs::write(folder.path().join("x.toml"), &toml).unwrap();
        fs::write(folder.path().join("a.csv"), "t_s,v1_v,tip_z_mm\n0,0,1\n0.1,0,1\n").unwrap();
        let output = sfers(folder.path(), &["diagnose", "x.toml", "--out", "d"]);
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{toml}: {text}");
        assert!(words.iter().all(|word| text.contains(word)), "{words:?} in {text}\n{toml}");
        assert!(!folder.path().join("d").exists(), "{toml}");
    }
}
