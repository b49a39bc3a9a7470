//! The command as a user types it: results, messages, exit codes, files.

mod common;

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use proptest::prelude::*;
use sfers::experiment::{Source, experiment};
use sfers::recording::npz;

/// A cantilever that is quick to run.
const CANTILEVER: &str = "[robot]\nactuators = 1\nmotors_per_actuator = 3\nmount = \"clamped\"\ndamping_eta = 0.05\n\
    [drive]\nwaveform = \"dc\"\nvoltages_v = [-1000]\n\
    [simulation]\ntime_step_s = 1e-5\nsteps = 200\nrecord_every_steps = 50\n";

/// A folder with an experiment in it.
struct Bench(tempfile::TempDir);

impl Bench {
    fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a.toml"), text).unwrap();
        Self(folder)
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.0.path().join(name)
    }

    fn sfers(&self, arguments: &[&str]) -> Output {
        common::sfers(self.0.path(), arguments)
    }

    /// Runs `a.toml` with arguments; demands an exit code and words on stderr, and no file but those that were there.
    fn refuses(&self, arguments: &[&str], code: i32, words: &[&str]) {
        let before = self.files();
        let output = self.sfers(arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
        for word in words {
            assert!(text.contains(word), "{arguments:?}: {word:?} is not in {text}");
        }
        assert_eq!(self.files(), before, "{arguments:?} left a file");
        assert!(output.stdout.is_empty(), "{arguments:?} wrote a result");
    }

    fn files(&self) -> Vec<std::ffi::OsString> {
        let mut names: Vec<_> = fs::read_dir(self.0.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    }
}

fn out(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn recordings() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/recordings"))
}

#[test]
fn a_run_prints_its_measures_and_saves_recording_and_manifest() {
    let bench = Bench::new(CANTILEVER);
    let output = bench.sfers(&["run", "a.toml", "--out", "a.npz"]);
    assert!(output.status.success());
    assert!(out(&output).contains("tip_deflection_mm = -"), "{}", out(&output));
    let recording = npz::read_file(&bench.path("a.npz")).unwrap();
    assert_eq!((recording.len(), recording.joints(), recording.meta.steps), (5, 3, 200));
    let manifest: serde_json::Value = serde_json::from_slice(&fs::read(bench.path("a.npz.manifest.json")).unwrap()).unwrap();
    for key in ["command", "experiment", "resolved_cgs", "git_revision", "version", "bullet", "seed", "wall_s"] {
        assert!(manifest.get(key).is_some(), "{key}");
    }
    assert_eq!(manifest["resolved_cgs"]["steps"], 200);
    assert_eq!(bench.files(), ["a.npz", "a.npz.manifest.json", "a.toml"]);
}

#[test]
fn json_is_one_object_with_a_schema_and_quiet_is_quiet() {
    #[derive(serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Result {
        schema: u32,
        measures: std::collections::BTreeMap<String, f64>,
        energy: std::collections::BTreeMap<String, Option<f64>>,
        time_step_s: f64,
        step_choice: Option<String>,
        steps: u64,
        records: usize,
        simulated_s: f64,
        interrupted: bool,
        warnings: Vec<String>,
        out: Option<String>,
        wall_s: f64,
        steps_per_s: f64,
    }
    let output = Bench::new(CANTILEVER).sfers(&["run", "a.toml", "--json", "--quiet"]);
    let result: Result = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((result.schema, result.steps, result.records), (1, 200, 5));
    assert!(result.measures["tip_deflection_mm"] < 0.0);
    assert!(result.energy["electrical_in_erg"] > Some(0.0) && result.energy["fault"].is_none());
    assert!(output.stderr.is_empty());
}

#[test]
fn a_dash_reads_standard_input_and_writes_csv_to_standard_output() {
    let bench = Bench::new(CANTILEVER);
    let output = Command::new(env!("CARGO_BIN_EXE_sfers"))
        .args(["run", "-", "--out", "-"])
        .stdin(fs::File::open(bench.path("a.toml")).unwrap())
        .output()
        .unwrap();
    let text = out(&output);
    assert!(text.starts_with("t_s,theta1_rad,") && text.lines().count() == 6, "{text}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("tip_deflection_mm"));
}

#[test]
fn settings_override_keys_with_numbers_words_and_lists() {
    let bench = Bench::new(CANTILEVER);
    let run = |settings: &[&str]| {
        let mut arguments = vec!["run", "a.toml", "--quiet"];
        for setting in settings {
            arguments.extend(["--set", setting]);
        }
        out(&bench.sfers(&arguments))
    };
    let nominal = run(&[]);
    assert_ne!(run(&["drive.voltages_v=[500]"]), nominal);
    assert_ne!(run(&["material.preset=parameter-4"]), nominal);
    assert_eq!(run(&["robot.damping_eta=0.05"]), nominal);
}

#[test]
fn bad_experiments_are_refused_with_place_and_key_and_nothing_is_written() {
    for (from, to, words) in [
        ("actuators = 1", "actuators = 1\nlegs = 4", ["line 3", "legs"]),
        ("actuators = 1", "actuators = \"one\"", ["line 2", "actuators"]),
        ("actuators = 1", "actuators = 0", ["line 2", "robot.actuators"]),
        ("motors_per_actuator = 3", "motors_per_actuator = 0", ["line 3", "robot.motors_per_actuator"]),
        ("damping_eta = 0.05", "damping_eta = nan", ["line 5", "robot.damping_eta"]),
        ("damping_eta = 0.05", "damping_eta = 0.05\ndamping_time_s = 0.1", ["line 6", "damping_time_s"]),
        ("damping_eta = 0.05", "damping_eta = -0.05", ["line 5", "robot.damping_eta"]),
        ("[robot]", "[material]\nactuator_length_mm = -1\n[robot]", ["line 2", "material.actuator_length_mm"]),
        ("[robot]", "[material]\npiezo_density_g_cm3 = -1\n[robot]", ["line 2", "material.piezo_density_g_cm3"]),
        ("voltages_v = [-1000]", "voltages_v = [1, 2]", ["line 8", "drive.voltages_v"]),
        ("voltages_v = [-1000]", "voltages_v = [inf]", ["line 8", "drive.voltages_v"]),
        ("voltages_v = [-1000]", "voltages_v = [0]\nat_s = 1", ["line 9", "drive.at_s"]),
        ("\"dc\"", "\"square\"", ["line 7", "drive.waveform"]),
        ("steps = 200", "steps = 200\nduration_s = 1", ["line 12", "simulation.duration_s"]),
        ("steps = 200\n", "", ["line 9", "simulation.duration_s"]),
        ("time_step_s = 1e-5", "time_step_s = 0", ["line 10", "simulation.time_step_s"]),
        ("record_every_steps = 50", "record_every_steps = 201", ["line 12", "simulation.record_every_steps"]),
        ("steps = 200", "steps = 1000000000000", ["line 12", "simulation.record_every_steps"]),
        ("mount = \"clamped\"", "mount = \"glued\"", ["line 4", "robot.mount"]),
    ] {
        assert!(CANTILEVER.contains(from), "{from}");
        let bench = Bench::new(&CANTILEVER.replacen(from, to, 1));
        bench.refuses(&["run", "a.toml", "--out", "a.npz"], 2, &[&words[..], &["a.toml"]].concat());
    }
}

#[test]
fn a_gait_without_its_parameter_or_for_another_robot_is_refused() {
    let gait = "[drive]\nwaveform = \"gait\"\ngait = \"crawl\"\n[simulation]\ntime_step_s = 1e-5\nsteps = 10\n";
    Bench::new(gait).refuses(&["run", "a.toml"], 2, &["drive.period_s", "crawl"]);
    Bench::new(gait).refuses(&["run", "a.toml", "--set", "drive.delay_s=1"], 2, &["--set drive.delay_s=1", "period_s"]);
    let arguments = ["run", "a.toml", "--set", "drive.period_s=0.1", "--set", "robot.actuators=3"];
    Bench::new(gait).refuses(&arguments, 2, &["5 actuators"]);
}

#[test]
fn a_damaged_voltage_table_is_input_data_and_named_with_its_line() {
    let text = CANTILEVER.replace("\"dc\"\nvoltages_v = [-1000]", "\"csv\"\nfile = \"v.csv\"");
    for (table, word) in [
        (Some("t_s,v1_v\n0,1\n2,1\n1,1\n"), "line 4"),
        (Some("t_s,v2_v\n0,1\n"), "v1_v is missing"),
        (Some("t_s,v1_v\n0,fast\n"), "line 2"),
        (None, "v.csv"),
    ] {
        let bench = Bench::new(&text);
        if let Some(table) = table {
            fs::write(bench.path("v.csv"), table).unwrap();
        }
        bench.refuses(&["run", "a.toml", "--out", "a.npz"], 3, &["v.csv", word]);
    }
    let bench = Bench::new(&text);
    fs::write(bench.path("v.csv"), "t_s,v1_v\n0,-1000\n").unwrap();
    assert_eq!(out(&bench.sfers(&["run", "a.toml"])), out(&Bench::new(CANTILEVER).sfers(&["run", "a.toml"])));
}

#[test]
fn an_output_that_cannot_be_written_is_refused_before_the_run() {
    let bench = Bench::new(CANTILEVER);
    fs::create_dir(bench.path("folder.npz")).unwrap();
    for (name, word) in [("nowhere/a.npz", "nowhere/a.npz"), ("folder.npz", "folder"), ("a.txt", ".npz or .csv")] {
        // Ten billion steps: a run that begins would not come back.
        let arguments = [
            "run",
            "a.toml",
            "--out",
            name,
            "--set",
            "simulation.steps=10000000000",
            "--set",
            "simulation.record_every_steps=10000000000",
        ];
        bench.refuses(&arguments, 2, &[word]);
    }
}

#[test]
fn a_missing_experiment_a_bad_setting_and_an_unknown_preset_are_usage_errors() {
    let bench = Bench::new(CANTILEVER);
    bench.refuses(&["run", "b.toml"], 2, &["b.toml"]);
    bench.refuses(&["run", "a.toml", "--set", "robot.actuators"], 2, &["KEY=VALUE"]);
    bench.refuses(&["run", "a.toml", "--set", "robot.legs=4"], 2, &["--set robot.legs=4", "legs"]);
    bench.refuses(&["preset", "walker"], 2, &["walker", "sfers presets"]);
    bench.refuses(&["run"], 2, &["EXPERIMENT"]);
}

#[test]
fn a_run_that_diverges_ends_with_step_time_joint_and_a_step_to_try() {
    // Bullet limits velocities, so a number must overflow for a run to diverge: here the torque does.
    let bench = Bench::new(CANTILEVER);
    let arguments = [
        "run",
        "a.toml",
        "--out",
        "a.npz",
        "--quiet",
        "--set",
        "drive.voltages_v=[-1e308]",
        "--set",
        "material.max_field_kv_mm=inf",
    ];
    bench.refuses(&arguments, 4, &["step", "t = ", "joint", "try a time step below"]);
}

#[test]
fn a_velocity_at_bullets_limit_is_reported_and_no_measures_are_given() {
    let output = Bench::new(CANTILEVER).sfers(&["run", "a.toml", "--json", "--quiet", "--set", "simulation.time_step_s=1e-3"]);
    assert!(output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("limited a velocity to 100"));
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(result["warnings"].as_array().unwrap().iter().any(|w| w.as_str().unwrap().contains("limited")));
    // All but the one that tells of the trouble.
    assert_eq!(result["measures"].as_object().unwrap().keys().collect::<Vec<_>>(), ["energy_error"]);
}

#[test]
fn crosscheck_agrees_with_a_recording_and_finds_where_another_damping_departs() {
    let bench = Bench::new(CANTILEVER);
    let name = |extension: &str| recordings().join("cantilever-dc-m5").with_extension(extension).display().to_string();
    let arguments = ["crosscheck", &name("toml"), "--against", &name("npz")];
    let good = bench.sfers(&arguments);
    assert_eq!(good.status.code(), Some(0), "{}", String::from_utf8_lossy(&good.stderr));
    assert!(out(&good).contains("joint torques") && out(&good).contains("equal bits") && out(&good).contains("1 of 1 agree"));

    let bad = bench.sfers(&[&arguments[..], &["--set", "robot.damping_eta=0.02"]].concat());
    assert_eq!(bad.status.code(), Some(1));
    let line = out(&bad).lines().find(|line| line.contains("joint angles")).unwrap().to_owned();
    // The recording is flat at step 0; the damping acts from the first record after it, at step 499.
    assert!(
        line.contains("first at step 499, joint 1") && line.contains(" rad, ") && line.contains("allowed: equal bits"),
        "{line}"
    );
    assert!(line.contains("TOO FAR") && !out(&bad).contains("last place"), "{}", out(&bad));

    let json = bench.sfers(&[&arguments[..], &["--set", "simulation.steps=20000", "--json"]].concat());
    let report: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!((&report["schema"], &report["passes"]), (&1.into(), &false.into()));
    assert!(report["comparisons"][0]["report"]["mismatch"][0].as_str().unwrap().contains("steps"));
}

#[test]
fn a_damaged_recording_is_input_data_and_nothing_to_compare_with_is_usage() {
    let bench = Bench::new(CANTILEVER);
    let whole = fs::read(recordings().join("cantilever-dc-m3.npz")).unwrap();
    fs::write(bench.path("cut.npz"), &whole[..whole.len() / 2]).unwrap();
    fs::write(bench.path("text.npz"), "no archive").unwrap();
    let mut archive = ndarray_npy::NpzWriter::new(fs::File::create(bench.path("odd.npz")).unwrap());
    for (key, value) in [("N", 1_i64), ("m", 3)] {
        archive.add_array(key, &ndarray::arr0(value)).unwrap();
    }
    archive.add_array("dataTime", &ndarray::Array1::<f64>::zeros(4)).unwrap();
    archive.add_array("dataTheta", &ndarray::Array2::<f64>::zeros((4, 7))).unwrap();
    for key in ["timeStep", "simCycles", "recordStepInterval", "actuatorLength", "drivenFrequency"] {
        archive.add_array(key, &ndarray::arr0(1.0)).unwrap();
    }
    archive.finish().unwrap();
    bench.refuses(&["crosscheck", "a.toml", "--against", "cut.npz"], 3, &["cut.npz", "cut short"]);
    bench.refuses(&["crosscheck", "a.toml", "--against", "text.npz"], 3, &["text.npz"]);
    bench.refuses(&["crosscheck", "a.toml", "--against", "odd.npz"], 3, &["odd.npz", "dataTheta", "[4, 7]"]);
    bench.refuses(&["crosscheck", "a.toml", "--against", "none.npz"], 3, &["none.npz"]);
    bench.refuses(&["crosscheck", "a.toml"], 2, &["--against"]);
    bench.refuses(&["crosscheck", "a.toml", "--pybullet", "no-such-python"], 2, &["no-such-python"]);
    bench.refuses(&["crosscheck", "a.toml", "--pybullet", "false"], 3, &["false"]);
}

#[test]
fn a_closed_pipe_ends_quietly() {
    let bench = Bench::new(CANTILEVER);
    let mut child = Command::new(env!("CARGO_BIN_EXE_sfers"))
        .args([
            "run",
            "a.toml",
            "--quiet",
            "--out",
            "-",
            "--set",
            "simulation.record_every_steps=1",
            "--set",
            "simulation.steps=20000",
        ])
        .current_dir(bench.0.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(!String::from_utf8_lossy(&output.stderr).contains("panic"));
}

#[test]
fn an_interrupt_keeps_what_was_recorded_and_says_so() {
    let bench = Bench::new(CANTILEVER);
    let child = Command::new(env!("CARGO_BIN_EXE_sfers"))
        .args([
            "run",
            "a.toml",
            "--quiet",
            "--out",
            "a.npz",
            "--set",
            "simulation.steps=2000000000",
            "--set",
            "simulation.record_every_steps=1000",
        ])
        .current_dir(bench.0.path())
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert!(String::from_utf8_lossy(&output.stderr).contains("interrupted after"));
    let recording = npz::read_file(&bench.path("a.npz")).unwrap();
    assert!(recording.len() > 2 && recording.meta.steps < 2_000_000_000, "{} records", recording.len());
}

proptest! {
    // Persisted failures would be written beside the sources of an installed test; the fixed seed makes them needless.
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn a_mangled_experiment_is_an_experiment_or_an_error_but_never_a_panic(
        edits in prop::collection::vec((any::<prop::sample::Index>(), 0usize..4, "[ -~]{0,6}"), 1..6),
    ) {
        let mut text: Vec<char> = CANTILEVER.chars().collect();
        for (index, length, insert) in edits {
            let at = index.index(text.len());
            let end = (at + length).min(text.len());
            text.splice(at..end, insert.chars());
        }
        let _ = experiment(&Source::from_text("mangled", text.into_iter().collect::<String>()));
    }
}

#[test]
fn a_run_goes_on_from_a_saved_state_with_the_same_bits_and_not_from_another_robots() {
    let bench = Bench::new(CANTILEVER);
    let done = |arguments: &[&str]| {
        let output = bench.sfers(arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    done(&["run", "a.toml", "--out", "whole.npz"]);
    done(&["run", "a.toml", "--set", "simulation.steps=120", "--save-state", "s.json"]);
    done(&["run", "a.toml", "--load-state", "s.json", "--out", "rest.npz"]);
    let whole = npz::read_file(&bench.path("whole.npz")).unwrap();
    let rest = npz::read_file(&bench.path("rest.npz")).unwrap();
    // Records of steps 149 and 199; the whole run has those of 0, 49, 99 before.
    assert_eq!((whole.len(), rest.len()), (5, 2));
    assert_eq!(rest.time, whole.time[3..]);
    assert_eq!(rest.angles, whole.angles[9..]);
    assert_eq!(rest.positions, whole.positions[45..]);

    bench.refuses(&["run", "a.toml", "--load-state", "s.json", "--set", "robot.damping_eta=0.1"], 3, &["damping_eta", "s.json"]);
    bench.refuses(&["run", "a.toml", "--load-state", "s.json", "--set", "simulation.steps=100"], 3, &["simulation.steps"]);
    bench.refuses(&["run", "a.toml", "--load-state", "a.toml"], 3, &["not a saved state"]);
    let cut = fs::read_to_string(bench.path("s.json")).unwrap().replace("\"state\":[", "\"state\":[1.0,");
    fs::write(bench.path("cut.json"), cut).unwrap();
    bench.refuses(&["run", "a.toml", "--load-state", "cut.json"], 3, &["cut.json"]);
    let huge = fs::read_to_string(bench.path("cut.json")).unwrap().replace("[1.0,", "[1e200,");
    fs::write(bench.path("huge.json"), huge).unwrap();
    bench.refuses(&["run", "a.toml", "--load-state", "huge.json"], 3, &["huge.json", "number 1 of the state is 1e200"]);
}

#[test]
fn the_planar_engine_chooses_its_step_starts_settled_and_is_judged_by_bullet() {
    let bench = Bench::new(&CANTILEVER.replace("steps = 200\nrecord_every_steps = 50", "duration_s = 0.1"));
    let planar = ["run", "a.toml", "--engine", "planar", "--json"];
    let run = |more: &[&str]| -> serde_json::Value {
        let output = bench.sfers(&[&planar[..], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let chosen = run(&["--set", "simulation.time_step_s=auto", "--set", "simulation.step_error=0.01"]);
    let choice = &chosen["step_choice"];
    assert!(choice["change"].as_f64().unwrap() <= 0.01, "{chosen}");
    assert_eq!(choice["tolerance_cm"], choice["trials"].as_array().unwrap().last().unwrap()["tolerance_cm"], "{chosen}");
    assert!(choice["longest_step_s"].as_f64().unwrap() < 1.001e-3, "{chosen}");
    let settled = run(&["--set", "simulation.start=settled"]);
    assert!(settled["energy"]["kinetic_erg"].as_f64().unwrap() < 1e-12, "{settled}");
    assert!((settled["measures"]["tip_deflection_mm"].as_f64().unwrap() + 18.987).abs() < 1e-3, "{settled}");

    let judged = bench.sfers(&["crosscheck", "--engines", "a.toml", "--planar-step", "1e-5"]);
    assert!(judged.status.success() && out(&judged).contains("a.toml: agree"), "{}", out(&judged));
    assert!(out(&judged).contains("errors of the steps"), "{}", out(&judged));

    // The bodies are those of the file when the step is chosen: twice as long, they swing at a quarter of the frequency.
    let long = bench.sfers(&["urdf", "a.toml", "--set", "material.actuator_length_mm=200"]);
    fs::write(bench.path("long.urdf"), &long.stdout).unwrap();
    let auto = ["--set", "simulation.time_step_s=auto", "--set", "simulation.step_error=0.01"];
    let chosen = run(&[&auto[..], &["--robot", "long.urdf"]].concat());
    assert!(chosen["step_choice"]["trials"].as_array().unwrap().len() > 1, "{chosen}");
    assert_ne!(chosen["step_choice"]["trials"], run(&auto)["step_choice"]["trials"], "{chosen}");

    bench.refuses(&["run", "a.toml", "--engine", "plane"], 2, &["plane", "bullet, planar"]);
    bench.refuses(&["run", "a.toml", "--set", "simulation.time_step_s=auto"], 2, &["simulation.time_step_s", "planar"]);
    bench.refuses(&["run", "a.toml", "--set", "simulation.start=settled"], 2, &["simulation.start", "planar"]);
    bench.refuses(&["run", "a.toml", "--set", "simulation.friction=coulomb"], 2, &["simulation.friction", "planar"]);
    bench.refuses(&[&planar[..], &["--set", "simulation.time_step_s=0.01"]].concat(), 4, &["0.01 s", "at most"]);
    bench.refuses(&["crosscheck", "--engines", "a.toml", "--planar-step", "0"], 2, &["--planar-step"]);
}

/// Bullet limits velocities to 1 m/s, which a body that falls freely reaches after 0.1 s; the planar engine lets it fall 0.44 m further.
#[test]
fn engines_get_no_verdict_where_one_gives_no_measures() {
    let bench = Bench::new(
        "[robot]\nactuators = 1\nmount = \"free\"\n[drive]\nwaveform = \"dc\"\nvoltages_v = [0]\n\
         [simulation]\ntime_step_s = 1e-5\nduration_s = 0.4\n",
    );
    let judged = bench.sfers(&["crosscheck", "--engines", "a.toml", "--planar-step", "1e-5"]);
    assert_eq!(judged.status.code(), Some(1), "{}", out(&judged));
    for words in ["a.toml: no verdict", "warning, Bullet: Bullet limited a velocity", "Bullet gives no measures"] {
        assert!(out(&judged).contains(words), "{words}: {}", out(&judged));
    }
    let json = bench.sfers(&["crosscheck", "--engines", "a.toml", "--planar-step", "1e-5", "--json"]);
    let json: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    let report = &json["comparisons"][0]["report"];
    assert_eq!((&json["passes"], &report["verdict"]), (&false.into(), &"no verdict".into()), "{json}");
    assert!(report["warnings"][0][0].as_str().unwrap().contains("limited a velocity"), "{json}");
    assert_eq!(report["warnings"][1], serde_json::json!([]), "{json}");
}

#[test]
fn a_spectrum_of_too_few_records_says_so() {
    let sine = CANTILEVER
        .replace("waveform = \"dc\"\nvoltages_v = [-1000]", "waveform = \"sine\"\namplitude_v = -1000\nfrequency_hz = 20")
        .replace("time_step_s = 1e-5\nsteps = 200\nrecord_every_steps = 50", "time_step_s = 1e-4\nduration_s = 0.3");
    let bench = Bench::new(&sine);
    for (interval, words) in
        [("1e-3", ""), ("1e-2", "harmonics of the drive from number 3"), ("0.03", "the drive (20 Hz) is above")]
    {
        let record = format!("simulation.record_every_s={interval}");
        let run = ["run", "a.toml", "--out", "a.npz", "--engine", "planar"];
        let done = bench.sfers(&[&run[..], &["--set", &record]].concat());
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let drawn = bench.sfers(&["plot", "a.npz", "--kind", "spectrum", "--out", "a.svg", "--quiet"]);
        let told = String::from_utf8_lossy(&drawn.stderr);
        assert!(drawn.status.success() && told.contains(words) && told.is_empty() == words.is_empty(), "{interval}: {told}");
    }
}

/// Bodies ten times as heavy sag ten times as far. Before, the step was chosen for the robot of the experiment file.
#[test]
fn an_automatic_step_is_chosen_for_the_robot_of_the_urdf() {
    let text = |density: &str| {
        format!(
            "[material]\nsubstrate_density_g_cm3 = {density}\n[robot]\nactuators = 1\nmount = \"clamped\"\n[drive]\nwaveform = \"dc\"\n\
             voltages_v = [0]\n[simulation]\nengine = \"planar\"\nstart = \"settled\"\ntime_step_s = \"auto\"\nduration_s = 0.01\n\
             step_measure = \"tip_deflection_mm\"\n"
        )
    };
    let bench = Bench::new(&text("8.1"));
    fs::write(bench.path("heavy.toml"), text("81.0")).unwrap();
    assert!(bench.sfers(&["urdf", "heavy.toml", "--out", "heavy.urdf"]).status.success());
    let run = |robot: &[&str]| -> (f64, f64) {
        let output = bench.sfers(&[&["run", "a.toml", "--json"], robot].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let tried = json["step_choice"]["trials"][0]["value"].as_f64().unwrap();
        (tried, json["measures"]["tip_deflection_mm"].as_f64().unwrap())
    };
    let (own, heavy) = (run(&[]), run(&["--robot", "heavy.urdf"]));
    assert!((own.0 / own.1 - 1.0).abs() < 1e-3 && (heavy.0 / heavy.1 - 1.0).abs() < 1e-3, "{own:?} {heavy:?}");
    assert!(heavy.0 / own.0 > 2.0, "{own:?} {heavy:?}");
}

/// At 5e-4 s the planar engine's mover on films of friction 4 goes 2.67 mm, at half of that 1.90 mm.
#[test]
fn strides_that_another_step_changes_get_no_verdict() {
    let bench = Bench::new(CANTILEVER);
    let settings = [
        "simulation.duration_s=0.5",
        "drive.delay_s=0.005",
        "robot.friction.low=0.2",
        "robot.friction.film_fraction=0.6666666666666666",
    ];
    let settings: Vec<&str> = settings.iter().flat_map(|setting| ["--set", setting]).collect();
    let judged =
        bench.sfers(&[&["crosscheck", "--engines", "mover-three-phase", "--planar-step", "5e-4"], &settings[..]].concat());
    assert_eq!(judged.status.code(), Some(1), "{}", out(&judged));
    assert!(out(&judged).contains("no verdict") && out(&judged).contains("with another step"), "{}", out(&judged));
}

/// With Coulomb's law solved, strides are Bullet's at that step; and where records are as far apart as the step its error is that to half the step.
#[test]
fn strides_on_rough_films_agree_at_long_steps_and_their_error_is_never_that_of_the_same_step() {
    let bench = Bench::new(CANTILEVER);
    let judge = |step: &str| {
        let settings = ["--set", "simulation.duration_s=0.4", "--set", "drive.frequency_hz=5", "--json"];
        let output = bench
            .sfers(&[&["crosscheck", "--engines", "full-frictional-inchworm", "--planar-step", step], &settings[..]].concat());
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()["comparisons"][0]["report"].clone()
    };
    let (near, far) = (judge("1e-4"), judge("1e-3"));
    assert_eq!(near["verdict"], "agree", "{near}");
    assert!(far["verdict"] != "agree" && far["measures"][0]["step_errors"][1].as_f64().unwrap() > 0.01, "{far}");
}
