//! The same bits from one and four threads, from two processes, and after a restore in the middle of a jump.

mod common;

use common::advance;
use sfers::engine::BulletEngine;
use sfers::experiment::{self, Control, Experiment, Source};

/// A jump of the whole robot: 12,000 steps, in the air from about step 6,000 on.
fn jump() -> Experiment {
    let text = experiment::presets::find("jump-14hz").unwrap().text;
    let mut source = Source::from_text("jump-14hz", text);
    for setting in ["simulation.time_step_s=1e-5", "simulation.duration_s=0.12", "simulation.record_every_steps=50"] {
        source.set(setting).unwrap();
    }
    experiment::experiment(&source).unwrap()
}

/// All bits of a run, as one list.
fn bits(experiment: &Experiment) -> Vec<u64> {
    let run = experiment::run(experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap();
    let r = run.recording;
    let arrays = [r.time, r.angles, r.rates, r.torques, r.motor_voltages, r.positions, r.velocities];
    arrays.iter().flatten().map(|value| value.to_bits()).collect()
}

#[test]
fn four_threads_with_a_world_each_give_the_bits_of_one() {
    let experiment = jump();
    let alone = bits(&experiment);
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(|| bits(&experiment))).collect();
        for thread in threads {
            assert!(thread.join().unwrap() == alone);
        }
    });
}

#[test]
fn two_processes_give_the_same_bytes() {
    let run = || {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_sfers"))
            .args(["run", "-", "--out", "-", "--quiet", "--set", "simulation.duration_s=0.06"])
            .stdin(std::fs::File::open("src/experiment/presets/jump-14hz.toml").unwrap())
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    };
    let first = run();
    assert!(first.len() > 10_000);
    assert!(first == run());
}

#[test]
fn a_snapshot_restored_in_the_middle_of_a_jump_goes_on_with_the_same_bits() {
    let experiment = jump();
    // On the ground with contacts, in the air, and back on the ground.
    for at in [4500, 7000, 9500] {
        let mut engine = experiment.engine().unwrap();
        advance(&experiment, engine.as_mut(), 0, at);
        let state = engine.save().unwrap();
        let on = advance(&experiment, engine.as_mut(), at, at + 2500);

        engine.load(at, &state).unwrap();
        assert_eq!(engine.step(), at);
        assert!(advance(&experiment, engine.as_mut(), at, at + 2500) == on, "the same engine, step {at}");

        let mut fresh = experiment.engine().unwrap();
        fresh.load(at, &state).unwrap();
        assert!(advance(&experiment, fresh.as_mut(), at, at + 2500) == on, "a fresh engine, step {at}");
    }
}

#[test]
fn the_snapshots_of_that_test_are_of_a_robot_on_the_ground_and_in_the_air() {
    let experiment = jump();
    let mut engine = BulletEngine::new(&experiment.robot, experiment.time_step).unwrap();
    let mut contacts = Vec::new();
    let mut counts = Vec::new();
    let mut from = 0;
    for at in [4500, 7000, 9500] {
        advance(&experiment, &mut engine, from, at);
        engine.world().0.contacts(&mut contacts).unwrap();
        counts.push(contacts.len());
        from = at;
    }
    assert!(counts[0] > 0 && counts.contains(&0), "{counts:?}");
}

#[test]
fn a_snapshot_of_another_robot_is_refused_and_changes_nothing() {
    let experiment = jump();
    let mut source = Source::from_text("x", experiment::presets::find("jump-14hz").unwrap().text);
    source.set("robot.motors_per_actuator=2").unwrap();
    let other = experiment::experiment(&source).unwrap();
    let foreign = other.engine().unwrap().save().unwrap();
    let mut engine = experiment.engine().unwrap();
    let before = engine.save().unwrap();
    assert!(engine.load(0, &foreign).is_err());
    assert_eq!(engine.save().unwrap(), before);
}
