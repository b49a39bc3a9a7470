//! Runs of the reference: PyBullet by a script of this program, or the authors' own classes.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde::Deserialize;
use serde_json::{Value, json};
use thiserror::Error;

use crate::drive::Waveform;
use crate::experiment::Experiment;
use crate::model::{Film, Material, Mount};
use crate::recording::{Recording, RecordingError, npz};

const REFERENCE_SCRIPT: &str = include_str!("reference.py");
const AUTHORS_SCRIPT: &str = include_str!("authors.py");

/// A failure of a cross-check.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CrosscheckError {
    /// Python could not be started.
    #[error("{}: {reason}; give a Python that has pybullet 3.2.7 and numpy with --pybullet (scripts/python.sh makes one)", python.display())]
    NoPython {
        /// The interpreter.
        python: PathBuf,
        /// Why.
        reason: String,
    },
    /// The script ended with an error.
    #[error("the reference failed on {} ({status}): {stderr}", python.display())]
    Failed {
        /// The interpreter.
        python: PathBuf,
        /// Its exit status.
        status: String,
        /// The last line it wrote.
        stderr: String,
    },
    /// The script's output is not a recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The authors' package has no class for this experiment.
    #[error("the authors' package has no class for this experiment: {0}")]
    NoClass(String),
    /// The experiment has what the reference has not.
    #[error("the reference has no {0}; leave it out for a comparison")]
    Beyond(&'static str),
    /// A temporary file could not be made.
    #[error("a temporary file could not be made: {0}")]
    Temporary(#[from] std::io::Error),
}

/// Versions that the reference ran with.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Versions {
    /// PyBullet's version.
    pub pybullet: String,
    /// numpy's version.
    pub numpy: String,
    /// Python's version.
    pub python: String,
}

/// Runs an experiment on PyBullet through its public API.
///
/// # Errors
/// [`CrosscheckError`] if Python, PyBullet or numpy is missing, the script fails, or the experiment is beyond the reference.
pub fn run_pybullet(experiment: &Experiment, python: &Path) -> Result<(Recording, Versions), CrosscheckError> {
    for (what, has) in [
        ("effects", !experiment.effects.is_empty()),
        ("payloads", !experiment.robot.masses.is_empty()),
        ("joint angles to start from", !experiment.joint_angles.is_empty()),
    ] {
        if has {
            return Err(CrosscheckError::Beyond(what));
        }
    }
    run_script(REFERENCE_SCRIPT, experiment.spec(), python)
}

/// Runs an experiment with the authors' classes, from a checkout of their package in the folder `sfers`.
///
/// # Errors
/// [`CrosscheckError::NoClass`] if none of their classes runs this experiment, and as [`run_pybullet`].
pub fn run_authors(experiment: &Experiment, python: &Path, sfers: &Path) -> Result<(Recording, Versions), CrosscheckError> {
    let run = authors_run(experiment)?;
    let mut spec = json!({
        "class": run.class, "mode": run.mode, "arg": run.arg, "parameter": run.parameter, "settings": run.settings,
    });
    spec["sfers_dir"] = json!(sfers.display().to_string());
    run_script(AUTHORS_SCRIPT, spec, python)
}

fn run_script(script: &str, mut spec: Value, python: &Path) -> Result<(Recording, Versions), CrosscheckError> {
    let folder = tempfile::tempdir()?;
    let out = folder.path().join("reference.npz");
    spec["out"] = json!(out.display().to_string());
    let mut child = Command::new(python)
        .args(["-c", script])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| CrosscheckError::NoPython { python: python.into(), reason: error.to_string() })?;
    let written = child.stdin.take().map(|mut stdin| stdin.write_all(spec.to_string().as_bytes()));
    let output = child.wait_with_output()?;
    let failed = |stderr: String| CrosscheckError::Failed { python: python.into(), status: output.status.to_string(), stderr };
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        // PyBullet always prints its build time.
        let last = text.lines().rfind(|line| !line.trim().is_empty() && !line.contains("build time")).unwrap_or("no message");
        return Err(failed(last.to_owned()));
    }
    if let Some(Err(error)) = written {
        return Err(failed(format!("it did not read its input: {error}")));
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let versions = text.lines().last().and_then(|line| serde_json::from_str(line).ok());
    let versions = versions.ok_or_else(|| failed("its output lacks the versions".into()))?;
    Ok((npz::read_file(&out)?, versions))
}

/// Call of the authors' package that runs an experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct AuthorsRun {
    /// Class of `sfers.robot_simulation.inchworm_envs`.
    pub class: &'static str,
    /// Method: dc, ac, step, drive or dcscan.
    pub mode: &'static str,
    /// Argument of the method.
    pub arg: Value,
    /// Name of the parameter set.
    pub parameter: &'static str,
    /// Attributes set on the object before the call.
    pub settings: Value,
}

/// Class, method and settings of the authors' package that run this experiment.
///
/// # Errors
/// [`CrosscheckError::NoClass`] with the reason if no class runs it.
pub fn authors_run(experiment: &Experiment) -> Result<AuthorsRun, CrosscheckError> {
    let robot = &experiment.robot;
    let m = &robot.material;
    let same_but_length = |set: Material| Material { actuator_length: m.actuator_length, ..set } == *m;
    let parameter = if same_but_length(Material::PARAMETER_2) {
        "trimorph parameter 2"
    } else if same_but_length(Material::PARAMETER_4) {
        "trimorph parameter 4"
    } else {
        return Err(no_class("the material is neither parameter set 2 nor 4"));
    };
    if experiment.drive.positive_gain != 1.0 {
        return Err(no_class("positive_gain is not 1"));
    }
    let mut settings = json!({
        "N": robot.actuators, "m": robot.motors_per_actuator, "timeStep": experiment.time_step, "simCycles": experiment.steps,
        "recordStepInterval": experiment.record_every, "dampingEta": robot.damping.eta(), "actuatorLength": m.actuator_length,
        "thickness": robot.collision_thickness,
    });
    let (class, mode, arg) = match robot.mount {
        Mount::Free => return Err(no_class("the robot is free")),
        Mount::Clamped => cantilever(experiment)?,
        Mount::Ground => {
            let f = &robot.friction;
            for (key, value) in [
                ("frictionLow", f.low),
                ("frictionHigh", f.high),
                ("groundFriction", f.ground),
                ("highFrictionalActuatorFraction", f.film_fraction),
            ] {
                settings[key] = json!(value);
            }
            if let Waveform::Gait { on_voltages, .. } = &experiment.drive.waveform {
                settings["onVoltages"] = json!(on_voltages);
            }
            crawler(experiment)?
        }
    };
    Ok(AuthorsRun { class, mode, arg, parameter, settings })
}

/// Class, method and argument.
type Call = (&'static str, &'static str, Value);

fn no_class(reason: impl Into<String>) -> CrosscheckError {
    CrosscheckError::NoClass(reason.into())
}

fn cantilever(experiment: &Experiment) -> Result<Call, CrosscheckError> {
    let robot = &experiment.robot;
    let class = "SingleActuatorCantilever";
    if robot.actuators != 1 {
        return Err(no_class("their cantilever has one actuator"));
    }
    match &experiment.drive.waveform {
        Waveform::Dc(voltages) => Ok((class, "dc", json!([voltages]))),
        Waveform::Sine { amplitudes, frequency } if *amplitudes == [-1500.0] => {
            Ok((class, "ac", json!([robot.motors_per_actuator, frequency, robot.material.actuator_length])))
        }
        Waveform::Step { voltages, at } if *voltages == [-1500.0] && *at == 2.0 * experiment.time_step => {
            Ok((class, "step", Value::Null))
        }
        _ => Err(no_class("their cantilever has dc, sine to -1500 V and step to -1500 V only")),
    }
}

fn crawler(experiment: &Experiment) -> Result<Call, CrosscheckError> {
    let both = experiment.robot.friction.film == Film::BothEnds;
    let (class, mode, arg, needs_both) = match &experiment.drive.waveform {
        Waveform::Dc(voltages) => ("InchwormDCResponseVoltageScan", "dcscan", json!([voltages]), false),
        Waveform::Gait { gait, parameter, .. } => {
            let (class, needs_both) = match gait.name {
                "inchworm" => ("Inchworm", false),
                "inchworm-backward" => ("InchwormBackward", false),
                "inchworm-reversed" => ("InchwormReversedPeriodScan", false),
                "full-inchworm" => ("FullInchwormPeriodScan", false),
                "full-frictional-inchworm" => ("FullFrictionalInchworm", true),
                "frog-v2" => ("FrictionalFrogMotionV2", true),
                "crawl" => ("InchwormCrawl", false),
                "jumper" => ("EfficientJumper", false),
                "jumper-delay" => ("EfficientJumperDelayScan", false),
                "jumper-pulse" => ("EfficientJumperActuatorLengthScan", false),
                "mover" => ("EfficientMover", true),
                "mover-delay" => ("EfficientMoverDelayScan", true),
                other => return Err(no_class(format!("gait {other} is from a notebook"))),
            };
            (class, "drive", json!([parameter]), needs_both)
        }
        _ => return Err(no_class("their robots have gaits and constant voltages only")),
    };
    if both != needs_both || experiment.robot.friction.film == Film::None {
        let place = if needs_both { "both ends" } else { "the right end" };
        return Err(no_class(format!("class {class} has its film under {place}")));
    }
    Ok((class, mode, arg))
}

#[cfg(test)]
mod tests {
    use super::super::BUILTIN;
    use super::*;
    use crate::experiment::{Source, experiment};

    #[test]
    fn the_built_in_experiments_are_the_calls_that_recorded_them() {
        for builtin in BUILTIN {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings").join(format!("{}.json", builtin.name));
            let recorded: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
            let run = authors_run(&experiment(&Source::from_text(builtin.name, builtin.experiment)).unwrap()).unwrap();
            for (key, ours) in
                [("class", json!(run.class)), ("mode", json!(run.mode)), ("arg", run.arg), ("parameter", json!(run.parameter))]
            {
                assert_eq!(ours, recorded[key], "{}: {key}", builtin.name);
            }
            for (key, value) in recorded["settings"].as_object().unwrap() {
                assert_eq!(run.settings[key], *value, "{}: {key}", builtin.name);
            }
        }
    }

    #[test]
    fn a_python_that_is_not_there_is_an_error_with_advice() {
        let experiment = experiment(&Source::from_text("x", BUILTIN[0].experiment)).unwrap();
        let error = run_pybullet(&experiment, Path::new("no-such-python")).unwrap_err();
        assert!(error.to_string().contains("--pybullet"), "{error}");
    }
}
