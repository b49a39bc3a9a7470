//! What lies outside the model's range is refused or gets no measures, and runs go on from states of runs of another length.

mod common;

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Output, Stdio};

use common::sfers;
use serde_json::Value;
use sfers::engine::{BulletEngine, Engine, EngineError, PlanarEngine};
use sfers::experiment::{self, Control, Experiment, Run, SavedState, Source};

const CANTILEVER: &str = "[robot]\nactuators = 1\nmount = \"clamped\"\n[drive]\nwaveform = \"dc\"\nvoltages_v = [-1000]\n\
    [simulation]\ntime_step_s = 1e-5\nduration_s = 0.02\n";
const DAMPED: &str = "[[effect]]\nid = \"damping\"\nscale = 8.889\n";

fn written(text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.toml"), text).unwrap();
    folder
}

fn run(text: &str, more: &[&str]) -> Output {
    sfers(written(text).path(), &[&["run", "a.toml", "--quiet"], more].concat())
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn json(output: &Output) -> Value {
    assert!(output.status.success(), "{}", words(output));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn experiment(text: &str) -> Experiment {
    experiment::experiment(&Source::from_text("test", text)).unwrap()
}

fn ran(experiment: &Experiment) -> Run {
    experiment::run(experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap()
}

/// Before, 1e-5 s gave +65.93 mm instead of −5.02 mm, and not a word.
#[test]
fn a_step_that_an_effect_on_damping_makes_unstable_gives_no_measures_and_names_a_stable_one() {
    let text = format!("{CANTILEVER}{DAMPED}");
    let output = run(&text, &["--json"]);
    let result = json(&output);
    let warning = result["warnings"][0].as_str().unwrap();
    assert!(
        warning.contains("is above the largest one that is stable") && warning.contains("simulation.time_step_s"),
        "{warning}"
    );
    assert!(words(&output).contains("no measures are given"), "{}", words(&output));
    assert!(result["measures"]["tip_deflection_mm"].is_null(), "{result}");
    let advised = warning.split("time_step_s to ").nth(1).unwrap().split(' ').next().unwrap();
    let stable = json(&run(&text, &["--json", "--set", &format!("simulation.time_step_s={advised}")]));
    assert!((stable["measures"]["tip_deflection_mm"].as_f64().unwrap() + 5.02).abs() < 0.02, "{stable}");
    // Implicit: any step is stable.
    let planar = json(&run(&text, &["--json", "--engine", "planar"]));
    assert!((planar["measures"]["tip_deflection_mm"].as_f64().unwrap() + 5.02).abs() < 0.02, "{planar}");
}

#[test]
fn a_sweep_says_of_a_point_with_an_unstable_step_that_it_failed() {
    let folder = written(&format!("{CANTILEVER}engine = \"bullet\"\n{DAMPED}"));
    let sweep =
        "experiment = \"a.toml\"\nmeasures = [\"tip_deflection_mm\"]\n[vary]\n\"simulation.time_step_s\" = [4e-6, 1e-5]\n";
    fs::write(folder.path().join("s.toml"), sweep).unwrap();
    assert!(sfers(folder.path(), &["sweep", "s.toml", "--out", "out"]).status.success());
    let results = fs::read_to_string(folder.path().join("out/results.csv")).unwrap();
    let lines: Vec<&str> = results.lines().collect();
    assert!(lines[1].ends_with(",ok") && lines[2].contains("failed: the time step 1e-5 s is above"), "{results}");
}

#[test]
fn a_voltage_that_the_material_does_not_bear_is_refused_in_every_waveform_with_its_limit_and_key() {
    let head = "[robot]\nactuators = 5\n[simulation]\ntime_step_s = 1e-5\nsteps = 10\n[drive]\n";
    for (drive, key, value) in [
        ("waveform = \"dc\"\nvoltages_v = [0, 0, 0, 0, -100000]", "drive.voltages_v", "-100000 V"),
        ("waveform = \"step\"\nvoltages_v = [2001, 0, 0, 0, 0]", "drive.voltages_v", "2001 V"),
        ("waveform = \"sine\"\namplitude_v = -2500\nfrequency_hz = 1", "drive.amplitude_v", "-2500 V"),
        ("waveform = \"sine\"\namplitudes_v = [1e300, 0, 0, 0, 0]\nfrequency_hz = 1", "drive.amplitudes_v", " V"),
        (
            "waveform = \"gait\"\ngait = \"inchworm\"\nperiod_s = 0.1\non_voltages_v = [0, 0, 0, 0, 3000]",
            "drive.on_voltages_v",
            "3000 V",
        ),
        ("waveform = \"sequence\"\nphases = [{ voltages_v = [0, 0, 0, 0, 3000] }]", "drive.phases: phase 1", "3000 V"),
    ] {
        let output = run(&format!("{head}{drive}\n"), &[]);
        let text = words(&output);
        assert_eq!(output.status.code(), Some(2), "{drive}: {text}");
        for word in [key, value, "at most 2000 V", "material.max_field_kv_mm"] {
            assert!(text.contains(word), "{drive}: {word:?} is not in {text}");
        }
        let raised = run(&format!("{head}{drive}\n[material]\nmax_field_kv_mm = inf\n"), &[]);
        assert_ne!(raised.status.code(), Some(2), "{drive}: {}", words(&raised));
    }
    // The factor on positive voltages counts, and the pitch.
    let gain = run(&CANTILEVER.replace("[-1000]", "[1500]").replace("[drive]", "positive_gain = 1.733\n[drive]"), &[]);
    assert!(gain.status.code() == Some(2) && words(&gain).contains("1500 V, times positive_gain 2599.5 V"), "{}", words(&gain));
    let pitch = run(CANTILEVER, &["--set", "material.electrode_pitch_mm=0.2"]);
    assert!(pitch.status.code() == Some(2) && words(&pitch).contains("at most 800 V"), "{}", words(&pitch));
}

#[test]
fn a_row_of_a_drive_file_or_of_measured_data_that_the_material_does_not_bear_is_named_with_its_line() {
    let folder = written(&CANTILEVER.replace("\"dc\"\nvoltages_v = [-1000]", "\"csv\"\nfile = \"v.csv\""));
    fs::write(folder.path().join("v.csv"), "t_s,v1_v\n0,0\n0.01,-100000\n").unwrap();
    let output = sfers(folder.path(), &["run", "a.toml"]);
    let text = words(&output);
    assert!(output.status.code() == Some(3) && text.contains("v.csv: line 3: column v1_v: is -100000 V"), "{text}");

    let data = "[robot]\nactuators = 1\nmount = \"clamped\"\n[markers]\ntip = 100.0\n[[run]]\nid = \"a\"\nfile = \"b.csv\"\n";
    fs::write(folder.path().join("d.toml"), data).unwrap();
    fs::write(folder.path().join("b.csv"), "t_s,v1_v,tip_z_mm\n0,0,1\n0.1,-9000,1\n").unwrap();
    let output = sfers(folder.path(), &["diagnose", "d.toml", "--out", "d"]);
    let text = words(&output);
    assert!(output.status.code() == Some(3) && text.contains("b.csv, line 3, column 2: v1_v is -9000 V"), "{text}");
}

/// Bent by a voltage that the limits were raised for; before, such runs had measures.
#[test]
fn bending_that_no_laminate_bears_is_warned_of_and_far_beyond_it_gives_no_measures() {
    let raised = |voltage: f64, engine: &str| {
        let voltage = format!("drive.voltages_v=[{voltage}]");
        run(CANTILEVER, &["--json", "--engine", engine, "--set", "material.max_field_kv_mm=inf", "--set", &voltage])
    };
    for engine in ["bullet", "planar"] {
        let fine = json(&raised(-1000.0, engine));
        assert_eq!(fine["warnings"].as_array().unwrap().len(), 0, "{fine}");
        let strained = raised(-8000.0, engine);
        assert!(words(&strained).contains("material.max_strain"), "{}", words(&strained));
        let strained = json(&strained);
        assert!(
            strained["warnings"][0].as_str().unwrap().contains("joint 1") && !strained["measures"]["tip_deflection_mm"].is_null()
        );
        for voltage in [-20_000.0, -100_000.0] {
            let broken = json(&raised(voltage, engine));
            assert!(broken["measures"]["tip_deflection_mm"].is_null(), "{engine} {voltage}: {broken}");
            assert!(
                broken["warnings"].as_array().unwrap().iter().any(|w| w.as_str().unwrap().contains("outside the model's range"))
            );
        }
    }
}

#[test]
fn a_number_of_steps_that_no_run_ends_is_refused() {
    let text = CANTILEVER.replace("duration_s = 0.02", "steps = 9200000000000000000");
    let output = run(&text, &[]);
    assert!(output.status.code() == Some(2) && words(&output).contains("simulation.steps"), "{}", words(&output));
}

#[test]
fn a_time_step_that_no_time_can_be_counted_in_is_refused() {
    for step in ["1e100", "1001", "1e-13"] {
        let output =
            run(CANTILEVER, &["--set", &format!("simulation.time_step_s={step}"), "--set", "simulation.duration_s=1e101"]);
        assert!(output.status.code() == Some(2) && words(&output).contains("simulation.time_step_s"), "{}", words(&output));
    }
}

/// 4,700 factors of 1.87 on the markers were infinite together.
#[test]
fn more_than_a_hundred_effects_are_refused() {
    let tables = |count: usize| CANTILEVER.to_owned() + &"[[effect]]\nid = \"sensor-scale\"\nscale = 1.001\n".repeat(count);
    assert!(run(&tables(100), &[]).status.success());
    let output = run(&tables(101), &[]);
    assert!(output.status.code() == Some(2) && words(&output).contains("at most 100"), "{}", words(&output));
}

#[test]
fn engines_refuse_a_step_of_zero_or_less_and_another_number_of_voltages() {
    let robot = experiment(CANTILEVER).robot;
    for step in [0.0, -1e-5, f64::NAN, f64::INFINITY] {
        assert!(matches!(PlanarEngine::new(&robot, step), Err(EngineError::TimeStep { .. })), "{step}");
        assert!(matches!(BulletEngine::new(&robot, step), Err(EngineError::TimeStep { .. })), "{step}");
    }
    let lagging = experiment(&format!("{CANTILEVER}[[effect]]\nid = \"driver-lag\"\ntime_constant_s = 1e-3\n"));
    let engines: [Box<dyn Engine>; 3] = [
        Box::new(PlanarEngine::new(&robot, 1e-5).unwrap()),
        Box::new(BulletEngine::new(&robot, 1e-5).unwrap()),
        lagging.engine().unwrap(),
    ];
    for mut engine in engines {
        for wrong in [&[][..], &[1.0, 2.0]] {
            let error = engine.prepare(wrong).unwrap_err();
            assert_eq!(error, EngineError::Voltages { given: wrong.len(), needed: 1 });
        }
        engine.prepare(&[1.0]).unwrap();
    }
}

/// The effects with memory, on a drive that never rests.
const WITH_MEMORY: [&str; 7] = [
    "id = \"hysteresis\"\nwidth = 0.2",
    "id = \"hysteresis\"\nwidth = 0.2\nplays = 1",
    "id = \"creep\"\nper_decade = 0.05\nslowest_s = 10",
    "id = \"driver-lag\"\ntime_constant_s = 2e-3",
    "id = \"slew-limit\"\nrate_v_per_s = 1e5",
    "id = \"structural-damping\"\nloss_factor = 0.1",
    "id = \"time-delay\"\ndelay_s = 3e-3",
];

fn swinging(engine: &str, effect: &str, seconds: f64) -> Experiment {
    experiment(&format!(
        "[robot]\nactuators = 1\nmount = \"clamped\"\n[drive]\nwaveform = \"sine\"\namplitude_v = -1000\nfrequency_hz = 20\n\
         [simulation]\nengine = \"{engine}\"\ntime_step_s = 2e-5\nduration_s = {seconds}\nrecord_every_steps = 50\n[[effect]]\n{effect}\n"
    ))
}

/// Runs an experiment from a state of a shorter one, through its file's text.
fn continued(from: &Experiment, to: &Experiment) -> Run {
    let mut engine = from.engine().unwrap();
    experiment::run(from, engine.as_mut(), |_| Control::Continue).unwrap();
    let text = serde_json::to_string(&SavedState::of(from, engine.as_ref()).unwrap()).unwrap();
    let mut engine = to.engine().unwrap();
    SavedState::parse(&text, to).unwrap().load_into(engine.as_mut()).unwrap();
    experiment::run(to, engine.as_mut(), |_| Control::Continue).unwrap()
}

#[test]
fn a_run_goes_on_from_a_shorter_run_with_the_same_bits_with_every_effect_that_has_memory() {
    for engine in ["bullet", "planar"] {
        for effect in WITH_MEMORY {
            let (short, long) = (swinging(engine, effect, 0.02), swinging(engine, effect, 0.06));
            let (whole, rest) = (ran(&long).recording, continued(&short, &long).recording);
            let from = whole.len() - rest.len();
            assert!(rest.len() > 30 && from > 10, "{engine} {effect}");
            assert_eq!(rest.time, whole.time[from..], "{engine} {effect}");
            assert_eq!(rest.angles, whole.angles[from * whole.joints()..], "{engine} {effect}");
            assert_eq!(rest.torques, whole.torques[from * whole.joints()..], "{engine} {effect}");
        }
    }
}

/// Without `slowest_s` the run's length decides the number of creep's levels: the state brings those that it began with.
#[test]
fn creep_goes_on_with_the_levels_that_a_run_began_with() {
    let effect = "id = \"creep\"\nper_decade = 0.05";
    for engine in ["bullet", "planar"] {
        let (short, long) = (swinging(engine, effect, 0.05), swinging(engine, effect, 0.5));
        let rest = continued(&short, &long).recording;
        // 0.1 s is the only level of the short run, which must not end there.
        let same = swinging(engine, "id = \"creep\"\nper_decade = 0.05\nslowest_s = 0.1", 0.5);
        let other = swinging(engine, effect, 0.5);
        let whole = ran(&same).recording;
        assert_eq!(rest.angles, whole.angles[(whole.len() - rest.len()) * 3..], "{engine}");
        assert_ne!(rest.angles, ran(&other).recording.angles[(whole.len() - rest.len()) * 3..], "{engine}");
    }
}

/// Against differences of the nodes' places, which on Bullet are recorded one step late but for the left end's.
#[test]
fn the_nodes_velocities_are_those_of_the_nodes_on_both_engines() {
    for (engine, late) in [("bullet", 1), ("planar", 0)] {
        // A robot that falls, turns and bends.
        let experiment = experiment(&format!(
            "[robot]\nactuators = 2\nmount = \"free\"\n[drive]\nwaveform = \"dc\"\nvoltages_v = [-1000, 200]\n[simulation]\n\
             engine = \"{engine}\"\ntime_step_s = 1e-6\nduration_s = 0.01\nrecord_every_steps = 1\n"
        ));
        let r = ran(&experiment).recording;
        let (h, nodes) = (experiment.time_step, r.nodes());
        let (mut apart, mut largest) = (0.0_f64, 0.0_f64);
        for record in (3..r.len() - 3).step_by(97) {
            for node in 0..nodes {
                // The left end's place is of its own time.
                let late = if node == 0 { 0 } else { late };
                for axis in [0, 2] {
                    let at = |record: usize| r.positions[3 * (record * nodes + node) + axis];
                    let found = r.node_velocities[3 * (record * nodes + node) + axis];
                    // A step on Bullet moves by the velocity at its end, one on the planar engine by the mean of both ends'.
                    let (end, steps) = if engine == "bullet" { (record + late, 1) } else { (record + 1, 2) };
                    let moved = (at(end) - at(end - steps)) / (steps as f64 * h);
                    apart = apart.max((found - moved).abs());
                    largest = largest.max(found.abs());
                }
            }
        }
        println!("{engine}: {apart:e} of {largest} cm/s");
        assert!(largest > 10.0 && apart < 1e-3 * largest, "{engine}: {apart} of {largest} cm/s");
        if engine == "planar" {
            assert_eq!(r.node_velocities, r.velocities);
        } else {
            assert_ne!(r.node_velocities, r.velocities);
        }
    }
}

#[test]
fn a_long_run_says_how_long_it_will_take_where_stderr_is_no_terminal() {
    let folder = written(&CANTILEVER.replace("duration_s = 0.02", "steps = 100000000000\nrecord_every_steps = 100000000"));
    let mut child = Command::new(env!("CARGO_BIN_EXE_sfers"))
        .args(["run", "a.toml"])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let line = BufReader::new(child.stderr.take().unwrap()).lines().next().unwrap().unwrap();
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(line.contains("of 100000000000 steps of 3 joints") && line.contains("left"), "{line}");
}

/// Periods of a trillionth of a step, which also kept a run busy for ever.
#[test]
fn a_drive_that_repeats_faster_than_the_steps_gives_no_measures() {
    for engine in ["bullet", "planar"] {
        let text = CANTILEVER.replace("\"dc\"\nvoltages_v = [-1000]", "\"sine\"\namplitude_v = -1000\nfrequency_hz = 1e15");
        let output = run(&text, &["--engine", engine]);
        let told = words(&output);
        let measures = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success() && told.contains("shorter than 4 time steps"), "{engine}: {told}");
        assert!(!measures.contains("tip_"), "{engine}: {measures}");
    }
}

/// One joint an actuator, as the paper has it too, comes beyond a right angle at its resonance; here a voltage does it.
#[test]
fn a_right_angle_between_links_is_warned_of_and_keeps_its_measures() {
    let settings = ["robot.motors_per_actuator=1", "material.max_field_kv_mm=inf", "drive.voltages_v=[-5000]"];
    let set: Vec<&str> = settings.iter().flat_map(|setting| ["--set", setting]).collect();
    let result = json(&run(CANTILEVER, &[&["--json", "--engine", "planar"], &set[..]].concat()));
    assert!(result["warnings"][0].as_str().unwrap().contains("right angle"), "{result}");
    assert!(!result["measures"]["tip_deflection_mm"].is_null(), "{result}");
}
