//! The fourteen recordings of the authors' code on PyBullet, bit for bit.
//!
//! This checks the implementation, not the physics. No tolerance on angles, rates and torques.

use sfers::crosscheck::{BUILTIN, compare};
use sfers::experiment::{self, Control, Source};
use sfers::recording::npz;

/// Runs every n-th recording; two tests share them, so that two cores do.
fn check(offset: usize) {
    for builtin in BUILTIN.iter().skip(offset).step_by(2) {
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
            assert!(ours.iter().zip(theirs).all(|(a, b)| a == b), "{}", builtin.name);
        }
    }
}

#[test]
fn every_other_recording_is_equal() {
    check(0);
}

#[test]
fn the_rest_of_the_recordings_is_equal() {
    check(1);
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
