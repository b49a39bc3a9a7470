//! The fourteen recordings of the authors' code on PyBullet, bit for bit.
//!
//! This checks the implementation, not the physics. No tolerance on angles, rates and torques.

use sfers::crosscheck::{BUILTIN, compare};
use sfers::experiment::{self, Control, Source};
use sfers::recording::npz;

/// Runs the recordings that are chosen by their names.
fn check(count: usize, chosen: impl Fn(&str) -> bool) {
    let chosen: Vec<_> = BUILTIN.iter().filter(|builtin| chosen(builtin.name)).collect();
    assert_eq!(chosen.len(), count);
    for builtin in chosen {
        let experiment = experiment::experiment(&Source::from_text(builtin.name, builtin.experiment)).unwrap();
        let theirs = npz::read(builtin.recording, builtin.name.as_ref()).unwrap();
        let ours = experiment::run(&experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap();
        let report = compare(&ours.recording, &theirs);
        assert!(report.passes, "{}: {report:#?}", builtin.name);
        // compare() takes +0 and -0 for equal; beyond that the bits are.
        for (ours, theirs) in [
            (&ours.recording.angles, &theirs.angles),
            (&ours.recording.rates, &theirs.rates),
            (&ours.recording.torques, &theirs.torques),
        ] {
            assert!(!ours.is_empty() && ours == theirs, "{}", builtin.name);
        }
    }
}

#[test]
fn the_recordings_of_cantilevers_are_equal() {
    check(5, |name| name.starts_with("cantilever"));
}

#[test]
fn a_recording_of_a_robot_on_the_floor_is_equal() {
    check(1, |name| name == "inchworm-m1");
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn the_recordings_of_robots_of_one_joint_an_actuator_on_the_floor_are_equal() {
    check(6, |name| !name.starts_with("cantilever") && name.ends_with("m1"));
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn the_recordings_of_robots_of_three_joints_an_actuator_on_the_floor_are_equal() {
    check(3, |name| !name.starts_with("cantilever") && name.ends_with("m3"));
}

#[test]
fn all_fourteen_are_built_in_and_unchanged() {
    assert_eq!(BUILTIN.len(), 14);
    let sums = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/recordings/SHA256SUMS")).unwrap();
    let output = std::process::Command::new("sha256sum")
        .args(["--check", "--strict", "SHA256SUMS"])
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/recordings"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    assert_eq!(sums.lines().count(), 28);
}
