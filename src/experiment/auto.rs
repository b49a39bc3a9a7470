//! Choosing the time step: the coarsest that halving once more changes little.

use serde::Serialize;

use super::config::{Config, Fault, StepConfig};
use super::resolve::Trouble;
use super::{Control, Experiment, run};
use crate::model::Robot;
use crate::recording::Recording;
use crate::recording::definitions;
use crate::recording::measures::Measures;
use crate::words::{not_one_of, number};

/// Share of the result that half the step may change, where a file does not say.
pub(crate) const DEFAULT_STEP_ERROR: f64 = 1e-3;
/// Where the search begins (s), and the finest step that it tries.
const COARSEST: f64 = 1e-3;
const FINEST: f64 = 1e-7;
/// Least length of the stretch that the step is tried on (s), and how many periods of the drive it covers.
const STRETCH: f64 = 0.1;
const PERIODS: f64 = 2.0;
/// Records of a stretch.
const RECORDS: f64 = 200.0;

/// How a time step was chosen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepChoice {
    /// The step (s).
    pub time_step_s: f64,
    /// What was compared: a measure's name, or `trajectory` for all nodes over all records.
    pub measure: String,
    /// Relative change of it from twice the step to this one.
    pub change: f64,
    /// Largest change that was allowed.
    pub asked: f64,
    /// Length of the run's beginning that was simulated for it (s).
    pub stretch_s: f64,
}

/// Chooses the step of a config with `time_step_s = "auto"` and resolves it with that step. The beginning of the run, two periods of the
/// drive or 0.1 s, is simulated with steps of 1 ms, 0.5 ms and so on, until the last halving changes the result by less than
/// `step_error`: the named measure relative to itself, or the path of all nodes (root of the mean square) relative to how far they go.
pub(super) fn choose(
    config: &Config,
    robot: &Robot,
    trials: bool,
    resolve: impl Fn(&Config) -> Result<Experiment, Trouble>,
) -> Result<Experiment, Trouble> {
    let s = &config.simulation;
    let asked = s.step_error.unwrap_or(DEFAULT_STEP_ERROR);
    if !(asked > 0.0 && asked < 1.0) {
        return Err(Fault::new("simulation.step_error", format!("is {}, but must lie between 0 and 1", number(asked))).into());
    }
    if let Some(name) = &s.step_measure
        && !definitions::names().contains(&name.as_str())
    {
        return Err(Fault::new("simulation.step_measure", not_one_of(name, &definitions::names())).into());
    }
    let Some(duration) = s.duration_s else {
        return Err(Fault::new("simulation.duration_s", "is missing; time_step_s = \"auto\" does not go with steps").into());
    };
    let at = |step: f64, duration: f64, record: Option<f64>| {
        let mut config = config.clone();
        let s = &mut config.simulation;
        (s.step_error, s.step_measure) = (None, None);
        s.time_step_s = Some(StepConfig::Seconds(step));
        s.duration_s = Some(duration);
        if record.is_some() {
            (s.record_every_s, s.record_every_steps, s.record_from_step) = (record, None, None);
        }
        resolve(&config)
    };
    // Checks everything else, and tells the period.
    let checked = at(COARSEST.min(duration), duration, Some(duration))?;
    if !trials {
        return Ok(checked);
    }
    let stretch = checked.drive.period().map_or(STRETCH, |period| (PERIODS * period).max(STRETCH)).min(duration);
    let mut step = stretch / (stretch / COARSEST).ceil();
    let every = (stretch / step / RECORDS).ceil() * step;
    let measure = s.step_measure.clone();
    let mut before: Option<Recording> = None;
    let mut last = (f64::NAN, f64::NAN);
    while step > FINEST {
        let trial = at(step, stretch, Some(every))?;
        // A step that is too coarse for the robot may fail; a finer one need not.
        let run = trial.engine().and_then(|mut engine| run(&trial, engine.as_mut(), |_| Control::Continue));
        let now = run.ok().filter(|run| run.trouble(&trial).is_empty()).map(|run| run.recording);
        if let (Some(coarse), Some(fine)) = (&before, &now) {
            let change = match &measure {
                None => path_change(coarse, fine),
                Some(name) => measure_change(name, coarse, fine, robot, trial.drive.period()).ok_or_else(|| {
                    let reason = format!("{name} cannot be had from the first {stretch} s of this experiment");
                    Fault::new("simulation.step_measure", reason)
                })?,
            };
            last = (step, change);
            if change <= asked {
                let mut experiment = at(duration / (duration / step).ceil(), duration, None)?;
                experiment.step_choice = Some(StepChoice {
                    time_step_s: experiment.time_step,
                    measure: measure.unwrap_or_else(|| "trajectory".into()),
                    change,
                    asked,
                    stretch_s: stretch,
                });
                experiment.config = config.clone();
                return Ok(experiment);
            }
        }
        before = now;
        step /= 2.0;
    }
    let reason = format!(
        "no step down to {FINEST} s changes the result by less than {asked}; the last change was {:.1e} at {:.1e} s",
        last.1, last.0
    );
    Err(Fault::new("simulation.step_error", reason).into())
}

/// Root mean square distance of all nodes in all records, relative to that of their travel.
fn path_change(coarse: &Recording, fine: &Recording) -> f64 {
    let first = &fine.positions[..3 * fine.nodes()];
    let (mut apart, mut travel) = (0.0, 0.0);
    for (a, b) in coarse.positions.chunks(first.len()).zip(fine.positions.chunks(first.len())) {
        for k in 0..first.len() {
            apart += (a[k] - b[k]).powi(2);
            travel += (b[k] - first[k]).powi(2);
        }
    }
    if apart == 0.0 { 0.0 } else { (apart / travel).sqrt() }
}

fn measure_change(name: &str, coarse: &Recording, fine: &Recording, robot: &Robot, period: Option<f64>) -> Option<f64> {
    let of = |recording: &Recording| Measures::of(recording, robot.mount, period).get(name);
    let (a, b) = (of(coarse)?, of(fine)?);
    Some(if a == b { 0.0 } else { ((a - b) / b).abs() })
}
