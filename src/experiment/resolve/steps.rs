//! Steps and records of a run, of one length or adaptive.

use super::super::adaptive::LONGEST;
use super::super::config::{Fault, SimulationConfig, StepConfig};
use super::super::{Accuracy, EngineKind, MAX_STEPS};
use crate::engine::FrictionModel;
use crate::model::{Mount, Robot};
use crate::recording::{MAX_VALUES, definitions};
use crate::words::{not_one_of, number};

/// Share of the result that a tighter tolerance may change, where a file does not say.
pub(crate) const DEFAULT_STEP_ERROR: f64 = 1e-3;
/// Times of records of adaptive runs are multiples of this (s) or less.
const GRID: f64 = 1e-4;
/// Time steps (s) of which `MAX_STEPS` have distinct times.
const MIN_TIME_STEP: f64 = 1e-12;
const MAX_TIME_STEP: f64 = 1e3;

/// What steps adapt to with `time_step_s = "auto"`.
pub(super) fn accuracy(s: &SimulationConfig, engine: EngineKind) -> Result<Option<Accuracy>, Fault> {
    let Some(StepConfig::Word(word)) = &s.time_step_s else {
        for (key, given) in [("step_error", s.step_error.is_some()), ("step_measure", s.step_measure.is_some())] {
            if given {
                return Err(Fault::new(format!("simulation.{key}"), "belongs to time_step_s = \"auto\""));
            }
        }
        return Ok(None);
    };
    if word != "auto" {
        return Err(Fault::new("simulation.time_step_s", format!("{word:?} is neither a number of seconds nor \"auto\"")));
    }
    if engine == EngineKind::Bullet {
        return Err(Fault::new("simulation.time_step_s", "auto needs engine = \"planar\""));
    }
    let error = s.step_error.unwrap_or(DEFAULT_STEP_ERROR);
    if !(error > 0.0 && error < 1.0) {
        return Err(Fault::new("simulation.step_error", format!("is {}, but must lie between 0 and 1", number(error))));
    }
    if let Some(name) = &s.step_measure
        && !definitions::names().contains(&name.as_str())
    {
        return Err(Fault::new("simulation.step_measure", not_one_of(name, &definitions::names())));
    }
    if s.duration_s.is_none() {
        return Err(Fault::new("simulation.duration_s", "is missing; time_step_s = \"auto\" does not go with steps"));
    }
    Ok(Some(Accuracy { measure: s.step_measure.clone(), error }))
}

/// Refuses what does not go with steps that adapt; `scale` (–) is the effects' factor on the time step.
pub(super) fn check_adaptive(robot: &Robot, friction: FrictionModel, scale: f64) -> Result<(), Fault> {
    if robot.mount == Mount::Ground && friction == FrictionModel::Convex {
        let message =
            "convex does not go with time_step_s = \"auto\": its error depends on the step; give one in seconds, or take coulomb";
        return Err(Fault::new("simulation.friction", message));
    }
    if scale != 1.0 {
        let message = "auto does not go with the effect discretisation's time_step_scale";
        return Err(Fault::new("simulation.time_step_s", message));
    }
    Ok(())
}

/// Time (s) of which all times of records are multiples, [`GRID`] or less: a part of the duration, and of the time between records if that goes into the duration.
/// The check of the experiment refuses values that make no grid.
fn record_grid(duration: f64, every: Option<f64>) -> f64 {
    let every = every.filter(|every| *every > 0.0);
    let goes_into_duration = |part: &f64| (duration / part - (duration / part).round()).abs() < 1e-6;
    every.map(|every| every / (every / GRID).ceil()).filter(goes_into_duration).unwrap_or_else(|| {
        let longest = duration / (duration / LONGEST).ceil();
        longest / (longest / every.unwrap_or(GRID).min(GRID)).ceil()
    })
}

/// The steps of a run.
pub(super) struct Steps {
    /// The time step (s); that of the records if steps adapt.
    pub time_step: f64,
    /// Number of steps.
    pub steps: u64,
    /// Steps from one record to the next.
    pub record_every: u64,
    /// The step before which the first regular record is taken.
    pub record_from: u64,
}

/// The steps of a run whose time step is `scale` (–) times the one given, or whose steps adapt.
pub(super) fn steps(s: &SimulationConfig, robot: &Robot, scale: f64, adaptive: bool) -> Result<Steps, Fault> {
    let positive = |key: &str, value: f64| {
        if value.is_finite() && value > 0.0 {
            Ok(value)
        } else {
            Err(Fault::new(key, format!("is {}, but must be positive", number(value))))
        }
    };
    let given = match (&s.time_step_s, s.duration_s) {
        (Some(StepConfig::Seconds(given)), _) => *given,
        (_, Some(duration)) if adaptive => record_grid(duration, s.record_every_s),
        _ => return Err(Fault::new("simulation.time_step_s", "is missing")),
    };
    let time_step = positive("simulation.time_step_s", given)? * scale;
    if !(MIN_TIME_STEP..=MAX_TIME_STEP).contains(&time_step) {
        let message = format!("is {} s; between {MIN_TIME_STEP:e} and {MAX_TIME_STEP:e} s are possible", number(time_step));
        return Err(Fault::new("simulation.time_step_s", message));
    }
    let in_steps = |key: &str, seconds: f64| {
        let steps = (positive(key, seconds)? / time_step).round();
        if (1.0..=MAX_STEPS).contains(&steps) {
            Ok(steps as u64)
        } else {
            Err(Fault::new(
                key,
                format!("is {} time steps of {} s; between 1 and {MAX_STEPS:e} are possible", number(steps), number(time_step)),
            ))
        }
    };
    let steps = match (s.steps, s.duration_s) {
        (Some(_), Some(_)) => {
            return Err(Fault::new("simulation.duration_s", "steps is given as well; keep one of the two"));
        }
        (None, None) => return Err(Fault::new("simulation.duration_s", "is missing; give duration_s or steps")),
        (Some(0), None) => return Err(Fault::new("simulation.steps", "is 0, but at least one step is needed")),
        (Some(steps), None) if steps as f64 > MAX_STEPS => {
            return Err(Fault::new("simulation.steps", format!("is {steps}; between 1 and {MAX_STEPS:e} are possible")));
        }
        (Some(steps), None) => steps,
        (None, Some(duration)) => in_steps("simulation.duration_s", duration)?,
    };
    let (record_key, record_every) = match (s.record_every_steps, s.record_every_s) {
        (Some(_), Some(_)) => {
            return Err(Fault::new("simulation.record_every_s", "record_every_steps is given as well; keep one of the two"));
        }
        (Some(every), None) => ("simulation.record_every_steps", every),
        (None, Some(seconds)) => ("simulation.record_every_s", in_steps("simulation.record_every_s", seconds)?),
        // About a thousand records.
        (None, None) => ("simulation.record_every_steps", (steps / 1000).max(1)),
    };
    if record_every == 0 || record_every > steps {
        return Err(Fault::new(record_key, format!("is {record_every} steps, but the run has {steps}")));
    }
    let values = (steps / record_every + 2) as f64 * (13.0 * robot.joints() as f64 + 19.0);
    if values > MAX_VALUES {
        let least = (record_every as f64 * values / MAX_VALUES).ceil();
        return Err(Fault::new(
            record_key,
            format!("{values:.1e} numbers would be recorded; record at most every {least:.0} steps"),
        ));
    }
    let record_from = match s.record_from_step {
        Some(from) => from,
        // The reference's records are a step before the multiples of their interval, which is nothing with short steps.
        None if adaptive => record_every.min(steps - 1),
        None => record_every - 1,
    };
    if record_from >= steps {
        return Err(Fault::new("simulation.record_from_step", format!("is {record_from}, but the run has {steps} steps")));
    }
    Ok(Steps { time_step, steps, record_every, record_from })
}
