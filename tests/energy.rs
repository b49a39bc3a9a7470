//! The energy audit: it closes where the physics is known, and it notices the kick that Bullet's contact gives.

use sfers::engine::{ENERGY_TOLERANCE, EnergyBalance};
use sfers::experiment::{self, Control, Experiment, Run, Source, presets};

fn experiment_of(text: &str, settings: &[&str]) -> Experiment {
    let mut source = Source::from_text("test", text);
    for setting in settings {
        source.set(setting).unwrap();
    }
    experiment::experiment(&source).unwrap()
}

fn run(experiment: &Experiment) -> Run {
    experiment::run(experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap()
}

fn balance(preset: &str, settings: &[&str]) -> EnergyBalance {
    run(&experiment_of(presets::find(preset).unwrap().text, settings)).energy
}

#[test]
fn a_free_robot_turns_height_into_speed() {
    let text = "[robot]\nactuators = 2\nmount = \"free\"\n[drive]\nwaveform = \"dc\"\nvoltages_v = [0, 0]\n[simulation]\ntime_step_s = 1e-5\nsteps = 5001\n";
    let experiment = experiment_of(text, &[]);
    let energy = run(&experiment).energy;
    let mass: f64 = experiment.robot.segments().iter().map(|segment| segment.mass).sum();
    // The audit is of before step 5000, at 0.05 s: m g² t²/2.
    let expected = 0.5 * mass * (980.0_f64 * 0.05).powi(2);
    assert!((energy.kinetic_erg / expected - 1.0).abs() < 1e-9, "{energy:?}");
    // Semi-implicit Euler falls farther than t² g/2 by the share Δt/t = 2e-4.
    assert!((energy.gravitational_erg / -expected - 1.0).abs() < 2.1e-4, "{energy:?}");
    // Joints that feel no force move by rounding only.
    assert!(energy.elastic_erg + energy.electrical_in_erg.abs() + energy.damping_out_erg < 1e-20, "{energy:?}");
    assert!(energy.error() < 1e-6 && energy.fault.is_none(), "{energy:?}");
}

/// At rest, half of the electrical work is stored in a spring that was charged from flat under constant voltage, the rest is heat.
#[test]
fn a_cantilever_without_weight_stores_half_of_the_work_and_burns_the_other() {
    let energy =
        balance("cantilever-dc", &["material.gravity_m_s2=1e-9", "simulation.time_step_s=1e-6", "simulation.duration_s=0.6"]);
    assert!((energy.elastic_erg / energy.electrical_in_erg - 0.5).abs() < 1e-3, "{energy:?}");
    assert!((energy.damping_out_erg / energy.electrical_in_erg - 0.5).abs() < 1e-3, "{energy:?}");
    assert!(energy.kinetic_erg < 1e-6 * energy.elastic_erg && energy.fault.is_none(), "{energy:?}");
}

/// The part that nothing supplied comes from the scheme, which is of first order: it halves with the step.
#[test]
fn the_audits_error_is_of_first_order_in_the_step() {
    let error = |step: &str| {
        balance("cantilever-step", &[&format!("simulation.time_step_s={step}"), "simulation.duration_s=0.1"]).error()
    };
    let ratio = error("1e-5") / error("5e-6");
    assert!((1.8..2.2).contains(&ratio), "{ratio}");
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn no_preset_gains_energy_beyond_half_the_tolerance() {
    for preset in presets::PRESETS {
        let energy = balance(preset.name, &["simulation.duration_s=0.12", "simulation.record_every_s=0.01"]);
        assert!(energy.fault.is_none() && energy.error() < 0.5 * ENERGY_TOLERANCE, "{}: {energy:?}", preset.name);
    }
}

/// The inchworm sequence at 10 Hz with smooth body and sticky ends: at about 0.28 s contact throws the robot 30 cm up.
#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn the_kick_at_10_hz_is_noticed_with_its_time_and_link_at_any_step() {
    for step in ["2e-5", "5e-6"] {
        let settings = [
            "robot.friction.low=0.2",
            "drive.frequency_hz=10",
            &format!("simulation.time_step_s={step}"),
            "simulation.duration_s=0.32",
        ];
        let experiment = experiment_of(presets::find("full-frictional-inchworm").unwrap().text, &settings);
        let run = run(&experiment);
        let fault = run.energy.fault.unwrap_or_else(|| panic!("step {step}: {:?}", run.energy));
        assert!((0.25..0.31).contains(&fault.time_s), "step {step}: {fault:?}");
        assert!(fault.link.is_some_and(|link| link < 16), "step {step}: {fault:?}");
        assert!(run.energy.error() > 0.3, "step {step}: {:?}", run.energy);
        let trouble = run.trouble(&experiment).join("\n");
        assert!(trouble.contains("energy appeared") && trouble.contains("on link"), "{trouble}");
        // Just before, nothing was wrong.
        let before = experiment_of(
            presets::find("full-frictional-inchworm").unwrap().text,
            &[settings[0], settings[1], settings[2], "simulation.duration_s=0.25"],
        );
        assert_eq!(self::run(&before).energy.fault, None);
    }
}
