//! The robot on Bullet against mechanics: statics, free fall, symmetry. The physics, not the implementation.

use sfers::experiment::{self, Control, Source, presets};
use sfers::model::Mount;
use sfers::recording::Recording;
use sfers::recording::measures::Measures;

fn record(preset: &str, settings: &[&str]) -> Recording {
    let mut source = Source::from_text(preset, presets::find(preset).unwrap().text);
    for setting in settings {
        source.set(setting).unwrap();
    }
    let experiment = experiment::experiment(&source).unwrap();
    experiment::run(&experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap().recording
}

#[test]
fn the_cantilever_bends_as_far_as_published_for_both_parameter_sets() {
    // Static tip at -1000 V, m = 3, gravity on, to the digits given.
    for (set, tip) in [("parameter-2", -18.99), ("parameter-4", -23.35)] {
        let recording = record("cantilever-dc", &[&format!("material.preset={set}")]);
        let found = Measures::of(&recording, Mount::Clamped, None).tip_deflection_mm.unwrap();
        assert!((found - tip).abs() < 0.006, "{set}: {found} mm");
    }
}

#[test]
fn a_positive_voltage_bends_up_and_a_negative_one_down() {
    for (volts, sign) in [(500.0, 1.0), (-500.0, -1.0)] {
        let settings = [&*format!("drive.voltages_v=[{volts}]"), "material.gravity_m_s2=0", "simulation.duration_s=0.2"];
        let found = Measures::of(&record("cantilever-dc", &settings), Mount::Clamped, None).tip_deflection_mm.unwrap();
        assert!(found * sign > 1.0, "{volts} V: {found} mm");
    }
}

#[test]
fn without_weight_the_tip_of_any_chain_turns_by_beta_v() {
    // Free joints rest at θ_V each, so that the whole chain turns by β V, whatever m.
    for m in [1, 3, 5] {
        let settings = [
            &*format!("robot.motors_per_actuator={m}"),
            "material.gravity_m_s2=0",
            "simulation.time_step_s=2e-6",
            "simulation.duration_s=0.4",
        ];
        let recording = record("cantilever-dc", &settings);
        let last = &recording.angles[recording.angles.len() - m..];
        let turned: f64 = last.iter().sum();
        // Residual seen: 4e-12 of the turn, what is left of the decay.
        assert!((turned / (3.6327811654911875e-4 * 1000.0) - 1.0).abs() < 1e-9, "m = {m}: {turned} rad");
    }
}

#[test]
fn a_free_robot_falls_as_a_stone_whatever_its_joints_do() {
    let settings = ["robot.mount=free", "simulation.duration_s=0.05", "simulation.record_every_steps=100"];
    let recording = record("jump-14hz", &settings);
    // The centre of mass: every joint is the middle of a link's mass but the two half links at the ends.
    let segments = |record: usize| {
        let node = |i: usize| recording.node(record, i)[2];
        let j = recording.joints();
        // Boxes span node to node; the first and last carry half the mass of the others.
        let mids: f64 = (1..j).map(|i| (node(i) + node(i + 1)) / 2.0).sum();
        (mids + (node(0) + node(1)) / 4.0 + (node(j) + node(j + 1)) / 4.0) / j as f64
    };
    let last = recording.len() - 1;
    let fallen = segments(0) - segments(last);
    let t = recording.time[last];
    // Nodes lag by one step behind the base, and semi-implicit Euler falls h/t further: seen together: 2e-4.
    assert!((fallen / (0.5 * 980.0 * t * t) - 1.0).abs() < 1e-3, "{fallen} cm in {t} s");
}

#[test]
fn a_symmetric_jump_stays_symmetric() {
    // Friction, voltages and masses mirror about the middle. The rows of contacts are solved one after another, which tilts the
    // robot by what the solver's residual leaves: seen at most 1.2e-3 cm in 0.12 s.
    let recording = record("jump-14hz", &["simulation.duration_s=0.12"]);
    for record in 0..recording.len() {
        for node in 0..recording.nodes() {
            let mirror = recording.nodes() - 1 - node;
            let (left, right) = (recording.node(record, node)[2], recording.node(record, mirror)[2]);
            assert!((left - right).abs() < 0.005, "record {record}, node {node}: {left} and {right} cm");
        }
    }
}
