//! Why a model cannot be simulated or fitted.

use std::error::Error;

use thiserror::Error;

use crate::effects::EffectError;
use crate::engine::EngineError;
use crate::experiment::ConfigError;

/// A model that cannot be simulated, so that no diagnosis is possible.
///
/// A [`Plant`](super::plant::Plant) of its own error type returns [`DiagnoseError::Plant`]; a text becomes one by `into`.
///
/// # Examples
/// ```
/// use sfers::diagnose::DiagnoseError;
/// let error: DiagnoseError = "the motion is not finite".into();
/// assert!(matches!(&error, DiagnoseError::Plant(_)) && error.to_string() == "the motion is not finite");
/// ```
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DiagnoseError {
    /// The engine cannot simulate the robot.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// An effect cannot be applied to the robot.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// The experiment of an observation is not valid.
    #[error(transparent)]
    Experiment(#[from] ConfigError),
    /// The experiment of an observation cannot be put together.
    #[error("{measure}: {reason}")]
    Observation {
        /// The observation's measure.
        measure: String,
        /// What is wrong.
        reason: String,
    },
    /// An observation's experiment does not define its measure.
    #[error("{measure} cannot be had from its drive")]
    Measure {
        /// The measure.
        measure: String,
    },
    /// A plant other than the robots of this crate.
    #[error(transparent)]
    Plant(#[from] Box<dyn Error + Send + Sync>),
}

impl From<String> for DiagnoseError {
    fn from(reason: String) -> Self {
        Self::Plant(reason.into())
    }
}

impl From<&str> for DiagnoseError {
    fn from(reason: &str) -> Self {
        Self::Plant(reason.into())
    }
}
