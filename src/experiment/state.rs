//! States on disk: a run can end here and go on elsewhere with the same bits.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Experiment;
use crate::engine::{Engine, EngineError};
use crate::words;

/// Largest size of a number of a state (CGS): its square times any constant of a robot is a number.
const LARGEST: f64 = 1e30;

/// A state between two steps, as a JSON object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedState {
    schema: u32,
    /// The robot and time step it belongs to, from [`Experiment::spec`].
    robot: Value,
    /// Number of steps taken.
    pub step: u64,
    state: Vec<f64>,
}

/// What of an experiment must be the same for a state to fit: all of the robot, and the step; drive and length may differ.
fn robot(experiment: &Experiment) -> Value {
    let mut spec = experiment.spec();
    if let Value::Object(fields) = &mut spec {
        for key in ["drive", "start", "joint_angles", "steps", "record_every_steps", "record_from_step"] {
            fields.remove(key);
        }
        // Limits decide no bits.
        if let Some(Value::Object(material)) = fields.get_mut("material") {
            for key in ["max_field", "max_strain"] {
                material.remove(key);
            }
        }
    }
    spec
}

impl SavedState {
    /// The state of an engine that runs `experiment`.
    ///
    /// # Errors
    /// Whatever the engine reports.
    pub fn of(experiment: &Experiment, engine: &dyn Engine) -> Result<Self, EngineError> {
        Ok(Self { schema: 1, robot: robot(experiment), step: engine.step(), state: engine.save()? })
    }

    /// Reads a state and checks that it is one of `experiment`'s robot.
    ///
    /// # Errors
    /// What is wrong with the text, in words.
    pub fn parse(text: &str, experiment: &Experiment) -> Result<Self, String> {
        let saved: Self =
            serde_json::from_str(text).map_err(|error| format!("not a saved state: {}", words::json_error(&error)))?;
        saved.check(experiment)?;
        Ok(saved)
    }

    /// Checks that it is a state of `experiment`'s robot.
    pub(crate) fn check(&self, experiment: &Experiment) -> Result<(), String> {
        if self.schema != 1 {
            return Err(format!("a state of schema {}, but this program reads schema 1", self.schema));
        }
        if let Some(at) = self.state.iter().position(|value| value.abs() > LARGEST) {
            return Err(format!("number {} of the state is {:e}: no robot comes into such a state", at + 1, self.state[at]));
        }
        let Value::Object(needed) = robot(experiment) else { return Err("no robot".into()) };
        match needed.iter().find(|(key, value)| self.robot.get(key) != Some(value)) {
            Some((key, value)) => {
                Err(format!("saved with another {key}: {} there, {value} here", self.robot.get(key).unwrap_or(&Value::Null)))
            }
            None => Ok(()),
        }
    }

    /// Puts an engine of the same robot into this state.
    ///
    /// # Errors
    /// Whatever the engine reports.
    pub fn load_into(&self, engine: &mut dyn Engine) -> Result<(), EngineError> {
        engine.load(self.step, &self.state)
    }
}
