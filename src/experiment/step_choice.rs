//! The accuracy asked of adaptive steps, and how they were chosen.

use serde::Serialize;

/// What adaptive steps must resolve.
#[derive(Debug, Clone, PartialEq)]
pub struct Accuracy {
    /// The measure; otherwise the trajectory of all nodes over all records.
    pub measure: Option<String>,
    /// Fraction of it by which a ten times tighter tolerance may change it.
    pub error: f64,
}

/// A run with one tolerance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepTrial {
    /// Largest local error of a step (cm).
    pub tolerance_cm: f64,
    /// Steps taken, halves and rejected ones included.
    pub steps: u64,
    /// The measure that is compared; absent for `trajectory`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Relative change from the ten times larger tolerance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub change: Option<f64>,
    /// Why the run gave no result.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

/// How the steps of a run were chosen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepChoice {
    /// Name of the measure, or `trajectory` for all nodes over all records.
    pub measure: String,
    /// Relative change from a ten times larger tolerance to the run's.
    pub change: f64,
    /// Largest relative change allowed.
    pub asked: f64,
    /// The run's tolerance (cm).
    pub tolerance_cm: f64,
    /// Shortest step of the run (s), impacts excluded.
    pub shortest_step_s: f64,
    /// Longest step of the run (s).
    pub longest_step_s: f64,
    /// All runs; the results are those of the last.
    pub trials: Vec<StepTrial>,
}
