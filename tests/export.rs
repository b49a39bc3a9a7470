//! URDF and MJCF files: those in `urdf/`, the way back through urdf-rs with the same bits, and files that are no robot.

mod common;

use std::fs;
use std::path::Path;

use common::sfers;
use proptest::prelude::*;
use sfers::experiment::{self, Control, Experiment, Source};
use sfers::export;

fn from_preset(preset: &str, settings: &[&str]) -> Experiment {
    let mut source = Source::from_text(preset, experiment::presets::find(preset).unwrap().text);
    for setting in settings {
        source.set(setting).unwrap();
    }
    experiment::experiment(&source).unwrap()
}

/// All bits of a short run.
fn bits(experiment: &Experiment) -> Vec<u64> {
    let run = experiment::run(experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap();
    let r = run.recording;
    [r.angles, r.rates, r.torques, r.positions, r.velocities].iter().flatten().map(|value| value.to_bits()).collect()
}

/// The standard robots, each with the preset and settings it is made of. `UPDATE=1 cargo test --test export` writes them anew.
const ROBOTS: [(&str, &str, &[&str]); 4] = [
    ("cantilever-m3", "cantilever-dc", &[]),
    ("cantilever-m3-parameter-4", "cantilever-dc", &["material.preset=parameter-4"]),
    ("five-actuators-m1", "full-frictional-inchworm", &["robot.motors_per_actuator=1"]),
    ("five-actuators-m3", "full-frictional-inchworm", &[]),
];

#[test]
fn the_files_in_urdf_are_what_the_program_exports() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("urdf");
    for (name, preset, settings) in ROBOTS {
        let experiment = from_preset(preset, settings);
        let set: String = settings.iter().map(|setting| format!(" --set {setting}")).collect();
        let command = |format: &str| format!("sfers preset {preset} | sfers {format} -{set}");
        let files = [
            (format!("{name}.urdf"), export::urdf(&experiment, &command("urdf"))),
            (format!("{name}.urdf.json"), format!("{:#}\n", export::sidecar(&experiment, &command("urdf")))),
            (format!("{name}.xml"), export::mjcf(&experiment, &command("mjcf"))),
        ];
        for (file, text) in files {
            let path = folder.join(&file);
            if std::env::var_os("UPDATE").is_some() {
                fs::write(&path, &text).unwrap();
            }
            assert_eq!(fs::read_to_string(&path).unwrap_or_default(), text, "{file}: run UPDATE=1 cargo test --test export");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(7), cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn a_robot_that_is_exported_and_read_back_runs_with_the_same_bits(
        actuators in 1..6usize, motors in 1..6usize, length in 30.0..120.0f64, width in 5.0..40.0f64, thickness in 0.3..1.5f64,
        low in 0.0..3.0f64, ground in any::<bool>(),
    ) {
        let settings = [
            format!("robot.actuators={actuators}"),
            format!("robot.motors_per_actuator={motors}"),
            format!("material.actuator_length_mm={length}"),
            format!("material.width_mm={width}"),
            format!("robot.collision_thickness_mm={thickness}"),
            format!("robot.friction.low={low}"),
            "robot.friction.film=right-end".into(),
            format!("robot.mount={}", if ground { "ground" } else { "clamped" }),
            format!("drive={{ waveform = \"dc\", voltages_v = {:?} }}", vec![-700.0; actuators]),
            "simulation={ time_step_s = 1e-6, steps = 400, record_every_steps = 40 }".into(),
        ];
        let built = from_preset("full-frictional-inchworm", &settings.iter().map(String::as_str).collect::<Vec<_>>());
        let text = export::urdf(&built, "a -- test");
        let mut read = built.clone();
        read.robot.bodies = Some(export::bodies(&text, &built.robot).unwrap());
        prop_assert_eq!(read.robot.bodies.clone().unwrap(), built.robot.segments());
        prop_assert_eq!(bits(&read), bits(&built));
    }

    #[test]
    fn any_text_is_a_chain_or_an_error_but_never_a_panic(at in 0.0..1.0f64, junk in ".{0,12}") {
        let robot = from_preset("cantilever-dc", &[]);
        let text = export::urdf(&robot, "x");
        let mut at = (at * text.len() as f64) as usize;
        while !text.is_char_boundary(at) {
            at -= 1;
        }
        for mangled in [text[..at].to_owned(), format!("{}{junk}{}", &text[..at], &text[at..]), junk] {
            let _ = export::bodies(&mangled, &robot.robot);
        }
    }
}

#[test]
fn what_is_no_chain_is_refused_by_the_name_of_its_element() {
    let experiment = from_preset("cantilever-dc", &[]);
    let good = export::urdf(&experiment, "x");
    let link_2 = &good[good.find("  <link name=\"link_2\">").unwrap()..];
    let link_2 = &link_2[..link_2.find("</link>").unwrap() + 7];
    let joint = |name: &str, parent: &str, child: &str| {
        format!(
            "<joint name=\"{name}\" type=\"continuous\"><parent link=\"{parent}\"/><child link=\"{child}\"/><axis xyz=\"0 1 0\"/></joint></robot>"
        )
    };
    let replaced = |from: &str, to: &str| good.replacen(from, to, 1);
    for (what, text, words) in [
        ("another axis", replaced("xyz=\"0 1 0\"", "xyz=\"0 0 1\""), vec!["joint_1", "0 1 0"]),
        ("a slider", replaced("continuous", "prismatic"), vec!["joint_1", "Prismatic", "hinge"]),
        ("no inertia", good.replace(link_2, &link_2.replace("inertial", "extra")), vec!["link_2", "<inertial>"]),
        ("no mass", good.replace(link_2, &link_2.replace("<mass", "<weight")), vec!["link_2", "<mass>"]),
        ("another inertia", good.replace(link_2, &link_2.replace("iyy=\"", "iyy=\"1")), vec!["link_2", "inertia"]),
        ("no friction", replaced("<contact><lateral_friction value=\"4\"/></contact>", ""), vec!["link_0", "lateral_friction"]),
        ("a missing link", replaced("<parent link=\"link_1\"/>", "<parent link=\"arm\"/>"), vec!["joint_2", "arm"]),
        ("a branch", replaced("</robot>", &joint("extra", "link_0", "link_3")), vec!["extra", "link_0"]),
        ("a loop", replaced("</robot>", &joint("extra", "link_3", "link_1")), vec!["extra", "loop", "joint_1"]),
        ("a closed ring", replaced("</robot>", &joint("extra", "link_3", "link_0")), vec!["base"]),
        ("a link twice", good.replace(link_2, &format!("{link_2}{link_2}")), vec!["link_2", "twice"]),
        (
            "a loose link",
            replaced("</robot>", &format!("{}</robot>", link_2.replace("link_2", "spare"))),
            vec!["spare", "connected"],
        ),
        (
            "limits",
            replaced("<axis", "<limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/><axis"),
            vec!["joint_1", "limits"],
        ),
        (
            "a shifted joint",
            replaced(
                "<parent link=\"link_0\"/><child link=\"link_1\"/>\n    <origin xyz=\"",
                "<parent link=\"link_0\"/><child link=\"link_1\"/>\n    <origin xyz=\"9",
            ),
            vec!["joint_1", "origin"],
        ),
        ("a cylinder", good.replace("<box size=", "<cylinder radius=\"1\" length=\"1\" size="), vec!["link_0", "box"]),
        ("other width", good.replace(" 2 0.1\"/></geometry>", " 3 0.1\"/></geometry>"), vec!["link_0", "width", "3"]),
        ("not a number", replaced("<mass value=\"", "<mass value=\"NaN\" old=\""), vec!["link_0", "mass"]),
        ("a negative mass", replaced("<mass value=\"", "<mass value=\"-"), vec!["link_0", "mass"]),
        ("cut short", good[..good.len() / 2].to_owned(), vec!["not a URDF"]),
        ("nothing", String::new(), vec!["not a URDF"]),
        ("another language", "<svg/>".into(), vec!["<svg>"]),
    ] {
        assert!(text != good, "{what}");
        let error = export::bodies(&text, &experiment.robot).expect_err(what).to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{what}: {error}");
    }
}

#[test]
fn nesting_without_end_is_an_error_and_no_crash() {
    let experiment = from_preset("cantilever-dc", &[]);
    for depth in [1000, 100_000] {
        let text = format!("<robot name=\"r\">{}{}</robot>", "<link name=\"a\">".repeat(depth), "</link>".repeat(depth));
        assert!(export::bodies(&text, &experiment.robot).is_err());
    }
}

#[test]
fn the_command_exports_and_runs_a_file_and_refuses_a_bad_one() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| sfers(folder.path(), arguments);
    fs::write(folder.path().join("a.toml"), experiment::presets::find("cantilever-dc").unwrap().text).unwrap();
    let output = run(&["urdf", "a.toml", "--out", "a.urdf"]);
    assert!(output.status.success() && folder.path().join("a.urdf.json").exists());
    let text = String::from_utf8(run(&["urdf", "a.toml"]).stdout).unwrap();
    assert_eq!(text, fs::read_to_string(folder.path().join("a.urdf")).unwrap());
    assert!(text.contains("sfers urdf a.toml"));
    assert!(String::from_utf8(run(&["mjcf", "a.toml"]).stdout).unwrap().contains("<mujoco"));

    let short = ["--set", "simulation.duration_s=0.01"];
    let plain = run(&[&["run", "a.toml"], &short[..]].concat());
    let read = run(&[&["run", "a.toml", "--robot", "a.urdf"], &short[..]].concat());
    assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
    assert_eq!(plain.stdout, read.stdout);

    // Effects stand in the file once: they are not applied to it again.
    let text_of_effects = "\n[[effect]]\nid = \"areal-mass\"\nscale = 1.1\n";
    fs::write(
        folder.path().join("b.toml"),
        experiment::presets::find("cantilever-dc").unwrap().text.to_owned() + text_of_effects,
    )
    .unwrap();
    assert!(run(&["urdf", "b.toml", "--out", "b.urdf"]).status.success());
    let heavier = run(&[&["run", "b.toml"], &short[..]].concat());
    let read = run(&[&["run", "b.toml", "--robot", "b.urdf"], &short[..]].concat());
    assert_ne!(heavier.stdout, plain.stdout);
    assert_eq!(heavier.stdout, read.stdout);
    let message = String::from_utf8_lossy(&read.stderr).into_owned();
    assert!(message.contains("warning: the links' masses are those of the robot's file"), "{message}");

    fs::write(folder.path().join("bad.urdf"), text.replace("continuous", "fixed")).unwrap();
    let bad = run(&["run", "a.toml", "--robot", "bad.urdf", "--out", "b.npz"]);
    let message = String::from_utf8_lossy(&bad.stderr).into_owned();
    assert_eq!(bad.status.code(), Some(3));
    assert!(message.contains("bad.urdf") && message.contains("joint_1"), "{message}");
    assert!(!folder.path().join("b.npz").exists());
    let other = run(&["run", "a.toml", "--robot", "a.urdf", "--set", "robot.motors_per_actuator=4"]);
    assert_eq!(other.status.code(), Some(2), "{}", String::from_utf8_lossy(&other.stderr));
    assert_eq!(run(&["run", "a.toml", "--robot", "none.urdf"]).status.code(), Some(3));
}
