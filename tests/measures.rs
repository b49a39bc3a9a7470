//! The measures of a run: those of its steps, however it is recorded.

mod common;

use std::fs;

use sfers::experiment::{self, Control, Experiment, Run, Source, presets};
use sfers::recording::measures::Measures;

fn experiment_of(name: &str, settings: &[&str]) -> Experiment {
    let mut source = Source::from_text(name, presets::find(name).unwrap().text);
    settings.iter().for_each(|setting| source.set(setting).unwrap());
    experiment::experiment(&source).unwrap()
}

fn run(experiment: &Experiment) -> Run {
    experiment::run(experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap()
}

/// Short runs on both engines: engine, preset, time step (s), duration (s).
const RUNS: [(&str, &str, &str, &str); 6] = [
    ("planar", "jump-14hz", "1e-4", "1.2"),
    ("planar", "full-frictional-inchworm", "2e-5", "0.5"),
    ("planar", "cantilever-ac", "1e-4", "0.5"),
    ("planar", "cantilever-step", "1e-4", "0.5"),
    ("bullet", "jump-14hz", "2e-5", "0.3"),
    ("bullet", "cantilever-ac", "1e-5", "0.2"),
];

fn short(run: (&str, &str, &str, &str), more: &[&str]) -> Experiment {
    let (engine, name, step, duration) = run;
    let settings = [
        format!("simulation.engine={engine}"),
        format!("simulation.time_step_s={step}"),
        format!("simulation.duration_s={duration}"),
    ];
    let settings: Vec<&str> = settings.iter().map(String::as_str).chain(more.iter().copied()).collect();
    experiment_of(name, &settings)
}

#[test]
fn measures_are_equal_for_all_record_intervals_from_every_step_to_two_records() {
    for case in RUNS {
        let mut experiment = short(case, &[]);
        let found: Vec<(usize, Measures)> = [1, 7, 500, experiment.steps]
            .into_iter()
            .map(|every| {
                (experiment.record_every, experiment.record_from) = (every, every - 1);
                let run = run(&experiment);
                (run.recording.len(), run.measures)
            })
            .collect();
        assert!(found[0].0 as u64 == experiment.steps && found[3].0 == 2, "{case:?}");
        assert!(found[0].1.named().len() > 3, "{case:?}: {found:?}");
        let plain = |measures: Measures| Measures { recorded_jump_height_mm: None, ..measures };
        for (_, measures) in &found {
            assert_eq!(plain(*measures), plain(found[0].1), "{case:?}");
        }
        assert_eq!(found[0].1.jump_height_mm.is_some(), !case.1.starts_with("cantilever"), "{case:?}");
        if let Some(height) = found[0].1.jump_height_mm {
            // Of two records, flat on the floor and at the end, the larger one says little of the jump.
            let recorded = |k: usize| found[k].1.recorded_jump_height_mm.unwrap();
            assert!((recorded(0) - height).abs() < 1e-9, "{case:?}: {} {height}", recorded(0));
            assert!(recorded(3) < 0.9 * height, "{case:?}: {} {height}", recorded(3));
        }
    }
}

/// The samples of a run are fewer than its steps; extremes are missed by 10⁻³ mm at most, and what is read at a time lies on it.
#[test]
fn the_measures_of_a_run_are_those_of_a_recording_of_all_steps() {
    let walkers = [
        ("planar", "inchworm", "1e-5", "0.5"),
        ("planar", "frog-v2", "1e-5", "0.5"),
        ("planar", "mover-three-phase", "1e-5", "0.2"),
        ("planar", "jump-on-time", "1e-5", "0.3"),
        ("planar", "jump-14hz", "4e-6", "0.5"),
        ("bullet", "inchworm", "2e-5", "0.3"),
    ];
    for case in RUNS.into_iter().chain(walkers) {
        let mut experiment = short(case, &[]);
        (experiment.record_every, experiment.record_from) = (1, 0);
        let run = run(&experiment);
        let all = Measures::of(&run.recording, experiment.robot.mount, experiment.drive.period());
        let mut compared = 0;
        for (name, of_all) in all.named() {
            let of_run = run.measures.get(&name).unwrap_or_else(|| panic!("{case:?}: no {name}"));
            let allowed = match name.as_str() {
                "jump_height_mm" | "displacement_sum_mm" | "recorded_jump_height_mm" => 1e-3,
                // The top of a parabola may stand higher than the highest step.
                "tip_amplitude_mm" => 1e-4 * of_all.abs(),
                "stride_mm" | "speed_mm_s" | "tip_deflection_mm" | "period_ratio" => 1e-9 * of_all.abs().max(1.0),
                "tip_phase_deg" | "mid_end_phase_deg" => 0.5,
                "resonance_hz" | "damping_ratio" | "half_power_bandwidth_hz" => 2e-3 * of_all.abs(),
                // Each of some ten changes is placed to half a hundredth of a period.
                "body_touching" | "end_touching" | "aerial" => 0.01,
                _ => panic!("{name} has no tolerance"),
            };
            assert!((of_run - of_all).abs() <= allowed, "{case:?}: {name} is {of_run}, of all steps {of_all}");
            compared += 1;
        }
        assert!(compared >= 3, "{case:?}");
    }
}

#[test]
fn what_a_camera_shifts_scales_and_delays_is_measured_as_it_is_seen() {
    let effects = "\n[[effect]]\nid = \"sensor-scale\"\nscale = 1.1\n[[effect]]\nid = \"sensor-delay\"\ndelay_s = 0.003\n";
    let text = format!("{}{effects}", presets::find("jump-14hz").unwrap().text);
    let mut source = Source::from_text("seen", text);
    for setting in ["simulation.engine=planar", "simulation.time_step_s=1e-4", "simulation.duration_s=0.5"] {
        source.set(setting).unwrap();
    }
    let mut seen = experiment::experiment(&source).unwrap();
    (seen.record_every, seen.record_from) = (1, 0);
    let run = run(&seen);
    let all = Measures::of(&run.recording, seen.robot.mount, seen.drive.period());
    let (a, b) = (run.measures.jump_height_mm.unwrap(), all.jump_height_mm.unwrap());
    // Cubics through two steps against straight lines between steps.
    assert!((a - b).abs() < 2e-3, "{a} {b}");
    let (a, b) = (run.measures.stride_mm.unwrap(), all.stride_mm.unwrap());
    assert!((a - b).abs() < 2e-3, "{a} {b}");
    (seen.record_every, seen.record_from) = (seen.steps, seen.steps - 1);
    assert_eq!(self::run(&seen).measures.jump_height_mm, run.measures.jump_height_mm);
}

/// Places alone and places with velocities are the same, at the same bits on Bullet, to rounding on the planar engine.
#[test]
fn places_are_those_of_the_nodes() {
    for (engine, allowed) in [("planar", 1e-12), ("bullet", 0.0)] {
        for name in ["jump-14hz", "cantilever-ac"] {
            let experiment = experiment_of(name, &[&format!("simulation.engine={engine}"), "simulation.time_step_s=2e-5"]);
            let mut robot = experiment.engine().unwrap();
            let count = experiment.robot.joints() + 2;
            let (mut positions, mut velocities) = (vec![0.0; 3 * count], vec![0.0; 3 * count]);
            let mut places = vec![[0.0; 2]; count];
            let mut highest: f64 = 0.0;
            for round in 1..=20 {
                let from = robot.step();
                common::advance(&experiment, robot.as_mut(), from, 100 * round);
                robot.places(&mut places).unwrap();
                robot.nodes(&mut positions, &mut velocities).unwrap();
                for (place, node) in places.iter().zip(positions.chunks(3)) {
                    assert!((place[0] - node[0]).abs() <= allowed && (place[1] - node[2]).abs() <= allowed, "{place:?} {node:?}");
                    highest = highest.max(node[2].abs());
                }
            }
            assert!(highest > 0.1, "{engine} {name}: it moves");
        }
    }
}

#[test]
fn an_interrupted_run_has_only_the_measures_that_need_no_end() {
    let experiment = short(RUNS[0], &[]);
    let mut engine = experiment.engine().unwrap();
    let stop = |done| if done > 6000 { Control::Stop } else { Control::Continue };
    let run = experiment::run(&experiment, engine.as_mut(), stop).unwrap();
    assert!(run.interrupted && run.measures.jump_height_mm.unwrap() > 5.0, "{:?}", run.measures);
    assert_eq!((run.measures.stride_mm, run.measures.speed_mm_s, run.measures.period_ratio), (None, None, None));
}

#[test]
fn the_command_prints_the_same_measures_however_densely_it_records() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("jump.toml"), presets::find("jump-14hz").unwrap().text).unwrap();
    let printed = |interval: &str| -> Vec<String> {
        let interval = format!("simulation.record_every_s={interval}");
        let planar = ["run", "jump.toml", "--engine", "planar", "--set", "simulation.time_step_s=1e-4", "--set", &interval];
        let output = common::sfers(folder.path(), &planar);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8(output.stdout).unwrap();
        text.lines().filter(|line| !line.starts_with("recorded_")).map(str::to_owned).collect()
    };
    let dense = printed("1e-4");
    assert!(dense.iter().any(|line| line.starts_with("jump_height_mm = 8.2")), "{dense:?}");
    assert_eq!(printed("0.5"), dense);
}
