//! Payloads: `[[robot.mass]]` on both engines, in the energy audit and in exports.

use sfers::experiment::{self, Control, Experiment, Run, Source};
use sfers::export;

const PAYLOAD: &str = "robot.mass=[{ position_mm = 62, mass_g = 1.5 }, { position_mm = 100, mass_g = 0.4 }]";

fn source(text: &str, settings: &[&str]) -> Source {
    let mut source = Source::from_text("payload", text);
    settings.iter().for_each(|setting| source.set(setting).unwrap());
    source
}

fn preset(name: &str, settings: &[&str]) -> Experiment {
    experiment::experiment(&source(experiment::presets::find(name).unwrap().text, settings)).unwrap()
}

fn run(experiment: &Experiment) -> Run {
    experiment::run(experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap()
}

/// The sheet sags further by F s²(3L − s)/(6 E I w) under a weight F at s, where the deflection is taken at the end L (Euler and Bernoulli).
#[test]
fn a_payload_deepens_the_sag_as_the_beam_says() {
    let settings =
        ["drive.voltages_v=[0]", "robot.motors_per_actuator=40", "simulation.engine=planar", "simulation.start=settled"];
    let tip = |mass: &str| run(&preset("cantilever-dc", &[&settings[..], &[mass]].concat())).measures.tip_deflection_mm.unwrap();
    let robot = preset("cantilever-dc", &settings).robot;
    let rigidity = sfers::model::Laminate::new(&robot.material).flexural_rigidity * robot.material.width;
    let (weight, at, length) = (0.1 * robot.material.gravity, 6.0, 10.0);
    let beam = -10.0 * weight * at * at * (3.0 * length - at) / (6.0 * rigidity);
    let chain = tip("robot.mass=[{ position_mm = 60, mass_g = 0.1 }]") - tip("robot.mass=[]");
    // 40 joints, and a deflection that is small beside the length: half a percent, measured.
    assert!((chain / beam - 1.0).abs() < 5e-3, "{chain} mm, the beam {beam} mm");
}

#[test]
fn a_payload_is_the_tip_mass_effect_bit_for_bit_on_both_engines() {
    let effects =
        "effect=[{ id = \"tip-mass\", mass_g = 1.5, position_mm = 62 }, { id = \"tip-mass\", mass_g = 0.4, position_mm = 100 }]";
    for engine in ["simulation.engine=planar", "simulation.engine=bullet"] {
        for name in ["cantilever-step", "jump-14hz"] {
            let settings = |more| [engine, "simulation.time_step_s=1e-5", "simulation.duration_s=0.05", more];
            let [payload, effect] = [PAYLOAD, effects].map(|more| run(&preset(name, &settings(more))));
            assert_eq!(payload.recording.angles, effect.recording.angles, "{name}, {engine}");
            assert_eq!(payload.recording.positions, effect.recording.positions, "{name}, {engine}");
            assert!(payload.audited && !effect.audited, "the audit knows payloads");
        }
    }
}

/// A free robot under gravity with a payload off its middle, bent by voltages: no contact, so nothing may appear in the contact account.
#[test]
fn the_audit_balances_a_free_robot_with_payloads() {
    let settings = ["robot.mount=free", "simulation.duration_s=0.05", "robot.damping_eta=0.045", PAYLOAD];
    let error = |engine: &str, step: &str| {
        let balance = run(&preset("static-shape", &[&settings[..], &[engine, step]].concat())).energy;
        let moved = balance.contact_in_erg + balance.contact_out_erg;
        assert!(balance.largest_erg > 1e3, "it moves: {balance:?}");
        moved / balance.largest_erg
    };
    // Bullet's explicit step is of first order: halves with the step.
    let [coarse, fine] =
        ["simulation.time_step_s=8e-6", "simulation.time_step_s=4e-6"].map(|step| error("simulation.engine=bullet", step));
    assert!(coarse < 5e-3 && fine < 0.6 * coarse, "{coarse} and {fine}");
    let planar = error("simulation.engine=planar", "simulation.time_step_s=1e-4");
    assert!(planar < 1e-9, "{planar}");
}

#[test]
fn both_engines_fall_alike_from_given_joint_angles() {
    let angles = format!("simulation.joint_angles_rad={:?}", (0..15).map(|i| 0.02 * f64::from(i % 4 - 1)).collect::<Vec<_>>());
    let settings = |engine: &'static str, step: &'static str| {
        preset("static-shape", &[engine, step, "drive.voltages_v=[0,0,0,0,0]", "simulation.duration_s=0.02", &angles, PAYLOAD])
    };
    let [planar, bullet] = [
        ("simulation.engine=planar", "simulation.time_step_s=1e-5"),
        ("simulation.engine=bullet", "simulation.time_step_s=1e-6"),
    ]
    .map(|(engine, step)| run(&settings(engine, step)).recording);
    // The lowest corner touches the floor. Nodes stand on the centre line, of which a tilted box's corner is nearer by half its thickness times 1 − cos.
    let lowest = (0..planar.nodes()).map(|node| planar.node(0, node)[2]).fold(f64::INFINITY, f64::min);
    assert!((-5e-4..0.0).contains(&lowest), "{lowest}");
    let last = |recording: &sfers::recording::Recording| {
        (0..recording.nodes()).map(|node| recording.node(recording.len() - 1, node)).map(|[x, _, z]| [x, z]).collect::<Vec<_>>()
    };
    let moved = last(&planar).iter().enumerate().map(|(node, at)| (at[1] - planar.node(0, node)[2]).abs()).fold(0.0, f64::max);
    let apart = last(&planar).iter().zip(last(&bullet)).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max);
    assert!(moved > 0.05, "it falls: {moved} cm");
    // Contact laws differ; 2 % of the motion, measured.
    assert!(apart < 0.02 * moved, "{apart} of {moved} cm");
}

#[test]
fn exports_hold_mass_centre_and_inertia_of_payloads() {
    let experiment = preset("full-frictional-inchworm", &["robot.mass=[{ position_mm = 140, mass_g = 3 }]"]);
    let bodies = experiment.robot.rigid_bodies();
    let mjcf = export::mjcf(&experiment, "test");
    let document = roxmltree::Document::parse(&mjcf).unwrap();
    let inertials: Vec<_> = document.descendants().filter(|node| node.has_tag_name("inertial")).collect();
    let number = |text: &str| text.split(' ').next().unwrap().parse::<f64>().unwrap();
    let mass: f64 = inertials.iter().map(|node| number(node.attribute("mass").unwrap())).sum();
    let plain: f64 = preset("full-frictional-inchworm", &[]).robot.segments().iter().map(|segment| segment.mass).sum();
    assert!((mass - plain - 3.0).abs() < 1e-12);
    // 140 mm is 6.67 mm into body 4, which begins at 116.67 + 16.67 mm.
    let loaded = inertials.iter().position(|node| number(node.attribute("mass").unwrap()) > 3.0).unwrap();
    assert_eq!(loaded, 4);
    let centre = number(inertials[4].attribute("pos").unwrap());
    assert!((centre - bodies[4].middle * experiment.robot.segments()[4].length).abs() < 1e-12);
    let urdf = export::urdf(&experiment, "test");
    assert!(
        urdf.contains(&format!("<mass value=\"{}\"/>", bodies[4].mass))
            && urdf.contains(&format!("iyy=\"{}\"", bodies[4].inertia))
    );
    let back = export::bodies(&urdf, &experiment.robot).unwrap_err().to_string();
    assert!(back.contains("link_4") && back.contains("[[robot.mass]]"), "{back}");
}

#[test]
fn a_payload_off_the_robot_or_below_nothing_is_refused_with_line_and_key() {
    for (mass, words) in [
        ("position_mm = 501\nmass_g = 1", ["position_mm", "501"]),
        ("position_mm = 1\nmass_g = -1", ["mass_g", "-1"]),
        ("position_mm = 1", ["mass_g", "missing"]),
        ("position_mm = 1\nmass_g = 1\nwidth_mm = 3", ["width_mm", "line"]),
    ] {
        let text = format!(
            "[drive]\nwaveform = \"dc\"\nvoltages_v = [0,0,0,0,0]\n[simulation]\ntime_step_s = 1e-5\nsteps = 1\n[[robot.mass]]\n{mass}\n"
        );
        let error = experiment::experiment(&source(&text, &[])).unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)) && error.contains("line"), "{mass}: {error}");
    }
}

/// The robot's end comes down at 1.3 m/s: Bullet's limit of 1 m/s acts at any step, and not once it is lifted.
#[test]
fn a_lifted_velocity_limit_lets_an_end_fall_as_on_the_planar_engine() {
    let settings = |limit: &'static str| {
        let length = ["simulation.time_step_s=1e-5", "simulation.duration_s=0.079", "simulation.record_every_steps=10"];
        preset(
            "full-frictional-inchworm",
            &[&length[..], &["drive.frequency_hz=8", "robot.damping_eta=0.008", "robot.friction.low=1.2", limit]].concat(),
        )
    };
    let (limited, lifted) = (run(&settings("simulation.velocity_limit=100")), run(&settings("simulation.velocity_limit=1e6")));
    let hits = limited.clamp_hits.unwrap();
    assert!((hits.first_step as f64 * 1e-5 - 0.07669).abs() < 1e-4, "{hits:?}");
    assert_eq!(lifted.clamp_hits, None);
    let mut planar = settings("simulation.velocity_limit=1e6");
    planar.engine = experiment::EngineKind::Planar;
    let planar = run(&planar).recording;
    let end = |recording: &sfers::recording::Recording| recording.node(recording.len() - 1, 0)[2];
    assert!((end(&lifted.recording) - end(&planar)).abs() < 0.02, "{} and {} cm", end(&lifted.recording), end(&planar));
    assert!((end(&limited.recording) - end(&planar)).abs() > 0.02, "{} and {} cm", end(&limited.recording), end(&planar));
    let mut wrong = source(experiment::presets::find("inchworm").unwrap().text, &["simulation.velocity_limit=0"]);
    assert!(experiment::experiment(&wrong).unwrap_err().to_string().contains("velocity_limit"));
    wrong.set("simulation.velocity_limit=5").unwrap();
    wrong.set("simulation.engine=planar").unwrap();
    assert!(experiment::experiment(&wrong).unwrap_err().to_string().contains("engine = \"bullet\""));
}
