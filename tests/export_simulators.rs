//! The exported robots in other simulators: PyBullet loads the URDF, MuJoCo the URDF and the MJCF.
//!
//! Needs a Python with pybullet, mujoco and numpy (`common/tools.rs`).

mod common;

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use common::tools;
use serde_json::Value;
use sfers::experiment::{self, Control, Experiment, Source};
use sfers::export;
use sfers::model::Mount;
use sfers::recording::measures::Measures;

fn script(python: &Path, name: &str, arguments: &[&str], input: &str) -> Value {
    let mut child = Command::new(python)
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(name))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{name}: {error}: {}", String::from_utf8_lossy(&output.stdout)))
}

fn from_preset(preset: &str, settings: &[&str]) -> Experiment {
    let mut source = Source::from_text(preset, experiment::presets::find(preset).unwrap().text);
    for setting in settings {
        source.set(setting).unwrap();
    }
    experiment::experiment(&source).unwrap()
}

/// Masses, inertias, frames and, over 0.1 s, the motion under the same torques, to 1e-9 relative.
#[test]
fn pybullet_loads_the_same_robot_from_the_urdf() {
    let test = "pybullet_loads_the_same_robot_from_the_urdf";
    let Some(python) = tools::python(test, &["pybullet", "numpy"]) else { return };
    let folder = tempfile::tempdir().unwrap();
    let length = "simulation={ time_step_s = 1e-5, duration_s = 0.1 }";
    for (preset, settings) in
        [("cantilever-dc", vec![length]), ("static-shape", vec![length, "robot.mount=free", "material.gravity_m_s2=1"])]
    {
        let experiment = from_preset(preset, &settings);
        let path = folder.path().join("robot.urdf");
        std::fs::write(&path, export::urdf(&experiment, "test")).unwrap();
        let answer = script(&python, "export_pybullet.py", &[path.to_str().unwrap()], &experiment.spec().to_string());
        assert_eq!(answer["links"], experiment.robot.joints() + 1, "{answer}");
        assert_eq!(answer["links"], answer["expected_links"]);
        assert_eq!(answer["steps"], 10_000);
        assert!(answer["largest_angle"].as_f64().unwrap() > 0.01, "{answer}");
        let frictions: Vec<f64> = experiment.robot.segments().iter().map(|segment| segment.friction).collect();
        assert_eq!(answer["frictions"], serde_json::json!(frictions));
        let properties = ["mass", "inertia", "inertial_frame", "joint_frame", "angles", "rates"];
        for key in properties {
            assert!(answer[key].as_f64().unwrap() < 1e-9, "{preset}, {key}: {answer}");
        }
        println!("{preset}: {answer}");
    }
}

/// The cantilever as it is, and with a payload near its end.
#[test]
fn mujoco_loads_urdf_and_mjcf_and_its_cantilever_bends_and_rings_alike() {
    let test = "mujoco_loads_urdf_and_mjcf_and_its_cantilever_bends_and_rings_alike";
    let Some(python) = tools::python(test, &["mujoco", "numpy"]) else { return };
    let folder = tempfile::tempdir().unwrap();
    for (payload, payload_g) in [("robot.mass=[]", 0.0), ("robot.mass=[{ position_mm = 90, mass_g = 0.2 }]", 0.2)] {
        let settings = ["simulation.time_step_s=4e-6", "simulation.duration_s=0.5", payload];
        let statics = from_preset("cantilever-dc", &settings);
        let ringing = from_preset("cantilever-step", &[&settings[..], &["robot.damping_eta=0.03"]].concat());
        let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        std::fs::write(path("a.urdf"), export::urdf(&ringing, "test")).unwrap();
        std::fs::write(path("a.json"), export::sidecar(&ringing, "test").to_string()).unwrap();
        std::fs::write(path("a.xml"), export::mjcf(&ringing, "test")).unwrap();
        let arguments = [&path("a.urdf"), &path("a.xml"), &path("a.json"), "-1000", "-1500"];
        let answer = script(&python, "export_mujoco.py", &arguments, "");

        let segments = ringing.robot.segments();
        let mass = segments.iter().map(|segment| segment.mass).sum::<f64>() + payload_g;
        assert_eq!(answer["mjcf_joints"], 3);
        assert!((answer["mjcf_mass"].as_f64().unwrap() / mass - 1.0).abs() < 1e-9, "{answer}");
        // In a URDF the base is part of the world for MuJoCo: its mass does not count.
        assert_eq!(answer["urdf_joints"], 3);
        assert!((answer["urdf_mass"].as_f64().unwrap() / (mass - segments[0].mass) - 1.0).abs() < 1e-9, "{answer}");

        let measure = |experiment: &Experiment, name: &str| {
            let run = experiment::run(experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap();
            Measures::of(&run.recording, Mount::Clamped, None).get(name).unwrap()
        };
        let relative = |key: &str, ours: f64| (answer[key].as_f64().unwrap() / ours - 1.0).abs();
        let tip = relative("tip_mm", measure(&statics, "tip_deflection_mm"));
        let resonance = relative("resonance_hz", measure(&ringing, "resonance_hz"));
        println!("{payload}: tip differs by {tip:.2e}, resonance by {resonance:.2e}: {answer}");
        assert!(tip < 0.002, "{answer}");
        assert!(resonance < 0.01, "{answer}");
    }
}
