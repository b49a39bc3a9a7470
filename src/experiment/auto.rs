//! `time_step_s = "auto"`: adaptive steps with a tolerance that is tightened until the result converges.

use std::fmt::Write as _;

use super::adaptive::{self, LONGEST, StepCount, Stopped};
use super::run::{Control, Run};
use super::step_choice::{Accuracy, StepChoice, StepTrial};
use super::{EngineKind, Experiment};
use crate::engine::{Engine, EngineError};
use crate::model::Mount;

/// The first tolerance as a fraction of the robot's length, per square of the allowed error; its lower limit; and the factor to the next. On the floor errors
/// go with about the square root of the tolerance, hence the square.
const LOOSEST: f64 = 0.02;
const FINEST: f64 = 1e-11;
const TIGHTER: f64 = 0.1;
/// Factor by which the change falls from one tolerance to the next at best: 10^(2/3), for local errors of third order.
const FALL: f64 = 4.64;
/// Most runs, with ever tighter tolerances.
const RUNS: usize = 6;
/// After the second and the third run the spread is tested if the result changes by more than these multiples of the allowed error.
const FAR: [f64; 2] = [5.0, 1.0];
/// Most steps of one run: this many, or `MOST_STEPS_OF_LONGEST` per longest step if that is more.
const MOST_STEPS: u64 = 2_000_000;
const MOST_STEPS_OF_LONGEST: u64 = 500;
/// Relative change of all coefficients of friction in the spread test.
const PERTURBATION: f64 = 2e-6;
/// Values below this (mm, deg, Hz, –) are zero but for rounding.
const ZERO: f64 = 1e-6;

/// A result to compare.
enum Observed {
    Value(f64),
    /// Positions of the nodes (cm) in all records, and the numbers per record.
    Path(Vec<f64>, usize),
}

/// Runs an experiment with ever tighter tolerances until its result changes by less than allowed.
pub(super) fn run(
    experiment: &Experiment,
    accuracy: &Accuracy,
    engine: &mut dyn Engine,
    mut observe: impl FnMut(u64) -> Control,
) -> Result<Run, EngineError> {
    let (first, start) = (engine.step(), engine.save()?);
    let mut ladder = Ladder::new(experiment, accuracy, first);
    for level in 0..RUNS {
        if level > 0 {
            engine.load(first, &start)?;
        }
        let (run, count) = match ladder.run(experiment, level, engine, &mut observe) {
            Ok(done) => done,
            Err(Stopped::TooLong) => return Err(ladder.not_converged("finer steps would be too many")),
            // Finer steps may do better.
            Err(Stopped::Failed(error)) if level + 1 < RUNS && matches!(error, EngineError::NotConverged { .. }) => {
                ladder.failed(level, error.to_string());
                continue;
            }
            Err(Stopped::Failed(error)) => return Err(error),
        };
        if run.interrupted {
            return Ok(run);
        }
        let trouble = run.trouble(experiment).pop();
        let known = ladder.troubled && trouble.is_some();
        ladder.take(level, &run, count, trouble)?;
        if known {
            // Measures are not given, whatever the steps.
            return Ok(run);
        }
        let Some(change) = ladder.trials.last().and_then(|trial| trial.change) else { continue };
        // Two runs that agree after a large change may do so by chance: a third must confirm.
        let before = ladder.trials[level - 1].change;
        if change <= accuracy.error && before.is_none_or(|before| before <= FAR[0] * accuracy.error) {
            return Ok(Run { step_choice: Some(ladder.choice(change, level, count)), ..run });
        }
        let times = change / accuracy.error;
        if let Some(far) = FAR.get(level - 1).filter(|far| first == 0 && times > **far)
            && let Some(spread) = ladder.spread(experiment, level - 1, *far)
        {
            return Err(ladder.not_converged(&spread));
        }
        if level > FAR.len() && times > FALL.powi((RUNS - 1 - level) as i32) {
            return Err(ladder.not_converged(&format!("it still changes by {change:.1e}")));
        }
    }
    Err(ladder.not_converged("no tighter tolerance confirms it"))
}

/// The runs so far.
struct Ladder<'a> {
    accuracy: &'a Accuracy,
    loosest: f64,
    most_steps: u64,
    trials: Vec<StepTrial>,
    last: Option<Observed>,
    /// True if the last run had trouble that leaves no measures.
    troubled: bool,
}

impl<'a> Ladder<'a> {
    fn new(experiment: &Experiment, accuracy: &'a Accuracy, first: u64) -> Self {
        let robot = &experiment.robot;
        let length = robot.material.actuator_length * robot.actuators as f64;
        let longest_steps = (experiment.steps.saturating_sub(first) as f64 * experiment.time_step / LONGEST) as u64;
        Self {
            accuracy,
            loosest: (LOOSEST * accuracy.error.powi(2)).max(FINEST) * length,
            most_steps: MOST_STEPS.max(longest_steps.saturating_mul(MOST_STEPS_OF_LONGEST)),
            trials: Vec::new(),
            last: None,
            troubled: false,
        }
    }

    fn tolerance(&self, level: usize) -> f64 {
        self.loosest * TIGHTER.powi(level as i32)
    }

    fn run(
        &self,
        experiment: &Experiment,
        level: usize,
        engine: &mut dyn Engine,
        observe: impl FnMut(u64) -> Control,
    ) -> Result<(Run, StepCount), Stopped> {
        adaptive::run(experiment, self.tolerance(level), self.most_steps, engine, observe)
    }

    fn failed(&mut self, level: usize, why: String) {
        let tolerance_cm = self.tolerance(level);
        self.trials.push(StepTrial { tolerance_cm, steps: 0, value: None, change: None, failed: Some(why) });
        self.last = None;
    }

    /// Takes a run's result.
    fn take(&mut self, level: usize, run: &Run, count: StepCount, trouble: Option<String>) -> Result<(), EngineError> {
        self.troubled = trouble.is_some();
        let observed = if trouble.is_some() { None } else { Some(self.observed(run)?) };
        let change = self.last.as_ref().zip(observed.as_ref()).map(|(before, now)| difference(before, now));
        let value = if let Some(Observed::Value(value)) = observed { Some(value) } else { None };
        self.trials.push(StepTrial { tolerance_cm: self.tolerance(level), steps: count.taken, value, change, failed: trouble });
        self.last = observed;
        Ok(())
    }

    fn observed(&self, run: &Run) -> Result<Observed, EngineError> {
        let Some(name) = self.accuracy.measure.as_deref() else {
            return Ok(Observed::Path(run.recording.positions.clone(), 3 * run.recording.nodes()));
        };
        run.measures.get(name).map(Observed::Value).ok_or_else(|| {
            EngineError::NotResolved(format!(
                "simulation.step_measure: {name} cannot be had from this experiment; take another or a longer run"
            ))
        })
    }

    fn choice(self, change: f64, level: usize, count: StepCount) -> StepChoice {
        StepChoice {
            measure: self.accuracy.measure.clone().unwrap_or_else(|| "trajectory".into()),
            change,
            asked: self.accuracy.error,
            tolerance_cm: self.tolerance(level),
            shortest_step_s: count.shortest,
            longest_step_s: count.longest,
            trials: self.trials,
        }
    }

    /// The measure's spread under tiny changes of friction, at the tolerance of a run already made, in words if it exceeds `times` the allowed error.
    fn spread(&self, experiment: &Experiment, level: usize, times: f64) -> Option<String> {
        let name = self.accuracy.measure.as_deref()?;
        if experiment.robot.mount != Mount::Ground || experiment.engine != EngineKind::Planar {
            return None;
        }
        let perturbed = [-PERTURBATION, PERTURBATION].into_iter().filter_map(|by| {
            let mut other = experiment.clone();
            other.record_only_what_measures_need(&[name]);
            other.robot.friction.ground *= 1.0 + by;
            let mut engine = other.engine().ok()?;
            let (run, _) = self.run(&other, level, engine.as_mut(), |_| Control::Continue).ok()?;
            run.measures.get(name)
        });
        let values: Vec<f64> = self.trials[level].value.into_iter().chain(perturbed).collect();
        let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
        (values.len() > 1 && high - low > times * self.accuracy.error * low.abs().max(high.abs())).then(|| {
            format!(
                "the motion is chaotic at this tolerance: when all friction changes by {PERTURBATION:e} of itself, it spreads from {low:.5} to {high:.5} with \
                 local errors of {:.0e} cm",
                self.tolerance(level)
            )
        })
    }

    fn not_converged(&self, reason: &str) -> EngineError {
        let what = self.accuracy.measure.as_deref().unwrap_or("trajectory");
        let mut text = format!("the {what} is not converged to {:e}: {reason}.", self.accuracy.error);
        for (index, trial) in self.trials.iter().enumerate() {
            let separator = if index == 0 { " With local errors of at most" } else { ";" };
            let _ = write!(text, "{separator} {:.0e} cm", trial.tolerance_cm);
            let _ = match (trial.value, trial.change, &trial.failed) {
                (Some(value), ..) => write!(text, " {value:.5}"),
                (_, Some(change), _) => write!(text, " changes by {change:.1e}"),
                (.., Some(why)) => write!(text, " failed ({why})"),
                _ => Ok(()),
            };
        }
        text.push_str(if self.trials.is_empty() { " " } else { ". " });
        text.push_str(
            "Try a larger simulation.step_error, a step_measure that depends less on each impact, a shorter duration_s or less friction, \
             or set time_step_s yourself and compare with finer ones",
        );
        EngineError::NotResolved(text)
    }
}

/// Relative difference of two results.
fn difference(coarse: &Observed, fine: &Observed) -> f64 {
    match (coarse, fine) {
        (Observed::Value(a), Observed::Value(b)) if a.abs().max(b.abs()) < ZERO => 0.0,
        (Observed::Value(a), Observed::Value(b)) => ((a - b) / b).abs(),
        (Observed::Path(a, width), Observed::Path(b, _)) => path_change(a, b, *width),
        _ => f64::INFINITY,
    }
}

/// Root mean square distance of all nodes in all records (`width` numbers each), relative to that of their travel.
fn path_change(coarse: &[f64], fine: &[f64], width: usize) -> f64 {
    let first = &fine[..width];
    let (mut apart, mut travel) = (0.0, 0.0);
    for (a, b) in coarse.chunks(width).zip(fine.chunks(width)) {
        for k in 0..width {
            apart += (a[k] - b[k]).powi(2);
            travel += (b[k] - first[k]).powi(2);
        }
    }
    if apart == 0.0 { 0.0 } else { (apart / travel).sqrt() }
}
