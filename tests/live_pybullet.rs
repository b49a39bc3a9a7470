//! Twenty robots drawn at random, here and on a live PyBullet 3.2.7: equal bits.
//!
//! Needs a Python with pybullet and numpy (`common/tools.rs`).

mod common;

use std::sync::Mutex;

use common::tools;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use sfers::analytic;
use sfers::crosscheck::{compare, run_pybullet};
use sfers::experiment::{self, Control, Experiment, Source};

const ROBOTS: usize = 20;

/// The waveform's lines of an experiment file, for `n` actuators.
fn drive(n: usize) -> BoxedStrategy<String> {
    let voltage = || (-1500.0..520.0f64).boxed();
    let voltages = move || prop::collection::vec(voltage(), n);
    let dc = voltages().prop_map(|v| format!("waveform = \"dc\"\nvoltages_v = {v:?}"));
    let sine =
        (voltages(), 5.0..60.0f64).prop_map(|(v, f)| format!("waveform = \"sine\"\namplitudes_v = {v:?}\nfrequency_hz = {f:?}"));
    let step = (voltages(), 0.0..0.0005f64).prop_map(|(v, at)| format!("waveform = \"step\"\nvoltages_v = {v:?}\nat_s = {at:?}"));
    let sequence = (voltages(), voltages(), 0.005..0.03f64, 0.2..0.8f64).prop_map(|(a, b, period, share)| {
        format!(
            "waveform = \"sequence\"\nperiod_s = {period:?}\nphases = [ {{ until = {share:?}, voltages_v = {a:?} }}, \
             {{ voltages_v = {b:?} }} ]"
        )
    });
    let gait =
        (prop::sample::select(vec!["inchworm", "full-frictional-inchworm", "frog-v2", "crawl"]), 0.01..0.05f64, voltages())
            .prop_map(|(gait, period, v)| {
                format!("waveform = \"gait\"\ngait = \"{gait}\"\nperiod_s = {period:?}\non_voltages_v = {v:?}")
            });
    if n == 5 { prop_oneof![gait, sequence].boxed() } else { prop_oneof![dc, sine, step, sequence].boxed() }
}

/// An experiment with the number of actuators `n`, as text, and its time step as a share of the largest stable one.
fn robot(n: usize) -> impl Strategy<Value = (String, f64)> {
    let shape = (1..=6usize, prop::bool::ANY, 40.0..120.0f64, prop::bool::weighted(0.3), 0.5..1.5f64);
    let friction = (0.1..2.0f64, 0.1..3.0f64, 0.5..6.0f64, prop::sample::select(vec!["both-ends", "right-end", "none"]));
    (shape, friction, 0.005..0.08f64, 1.0..1.8f64, drive(n), 0.2..0.8f64).prop_map(
        move |((m, four, length, clamped, thickness), (ground, low, high, film), damping, gain, drive, share)| {
            let preset = if four { "parameter-4" } else { "parameter-2" };
            let mount = if clamped { "clamped" } else { "ground" };
            // Two films do not fit under the shortest robots.
            let film = if n * m < 5 { "none" } else { film };
            let text = format!(
                "[material]\npreset = \"{preset}\"\nactuator_length_mm = {length:?}\n[robot]\nactuators = {n}\n\
                 motors_per_actuator = {m}\nmount = \"{mount}\"\ndamping_eta = {damping:?}\npositive_gain = {gain:?}\n\
                 collision_thickness_mm = {thickness:?}\n[robot.friction]\nground = {ground:?}\nlow = {low:?}\nhigh = {high:?}\n\
                 film = \"{film}\"\n[drive]\n{drive}\n[simulation]\ntime_step_s = 1e-9\nsteps = 8000\nrecord_every_steps = 50\n"
            );
            (text, share)
        },
    )
}

/// The robots. The generator's seed is proptest's fixed one for ChaCha, so they are the same in every run.
fn robots() -> Vec<Experiment> {
    let rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    (0..ROBOTS)
        .map(|i| {
            // One to seven actuators, each number at least twice.
            let (text, share) = robot(1 + i % 7).new_tree(&mut runner).unwrap().current();
            let draft = experiment::experiment(&Source::from_text(format!("robot {i}"), text.as_str())).unwrap();
            let mut source = Source::from_text(format!("robot {i}"), text);
            source.set(&format!("simulation.time_step_s={:?}", share * analytic::stable_step(&draft.robot))).unwrap();
            experiment::experiment(&source).unwrap()
        })
        .collect()
}

#[test]
fn twenty_random_robots_have_equal_bits_on_a_live_pybullet() {
    let test = "twenty_random_robots_have_equal_bits_on_a_live_pybullet";
    let Some(python) = tools::python(test, &["pybullet", "numpy"]) else { return };
    let queue = Mutex::new(robots().into_iter().enumerate());
    let moved = Mutex::new(0);
    let failures = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let Some((i, experiment)) = queue.lock().unwrap().next() else { break };
                    let (theirs, versions) = run_pybullet(&experiment, &python).unwrap();
                    assert_eq!(versions.pybullet, "3.2.7");
                    let run = experiment::run(&experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap();
                    let report = compare(&run.recording, &theirs);
                    if !report.passes {
                        let differing: Vec<_> = report.quantities.iter().filter(|q| !q.passes).collect();
                        let file = toml::to_string(&experiment.config).unwrap();
                        failures.lock().unwrap().push(format!("robot {i}: {:?} {differing:#?}\n{file}", report.mismatch));
                    }
                    *moved.lock().unwrap() += usize::from(run.recording.angles.iter().any(|angle| angle.abs() > 1e-3));
                }
            });
        }
    });
    let failures = failures.into_inner().unwrap();
    assert!(failures.is_empty(), "{} of {ROBOTS} differ:\n{}", failures.len(), failures.join("\n"));
    // Robots that do not move would agree without proving anything.
    let moved = moved.into_inner().unwrap();
    assert!(moved >= ROBOTS * 3 / 4, "only {moved} of {ROBOTS} bend by more than 1e-3 rad");
}
