//! Choosing the time step: the coarsest at which nothing that can be compared says that the result would be another.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::Serialize;

use super::config::{Config, ConfigError, Fault, StepConfig};
use super::resolve::Trouble;
use super::{Control, Experiment, run};
use crate::engine::FrictionModel;
use crate::model::{Mount, Robot};
use crate::recording::definitions;
use crate::words::{not_one_of, number};

/// Share of the result that another step may change, where a file does not say.
pub(crate) const DEFAULT_STEP_ERROR: f64 = 1e-3;
/// Where the search begins (s), and the finest step that it chooses.
const COARSEST: f64 = 1e-3;
const FINEST: f64 = 1e-7;
/// Halvings from a step to the far finer one that must confirm it. Contact has plateaus, on which a halving changes little and eight times
/// finer steps change all: with the convex model a mover on films of friction 4 moves 2.8 mm at all steps from 2.5·10⁻⁴ to 6·10⁻⁵ s, and 6.2 mm at an eighth.
const FAR: usize = 3;
/// Coulomb's law may differ from the convex model by this, whatever error is allowed: on that plateau they differ by 3 % and more (measured).
const MODELS: f64 = 0.01;
/// Steps of all trial runs together: this many, or those of so many runs by [`COARSEST`] if that is more. Some seconds for a robot of five actuators.
const BUDGET: u64 = 4_000_000;
const BUDGET_RUNS: u64 = 200;
/// Records of a trial run.
const RECORDS: f64 = 200.0;
/// Values below this (mm, deg, Hz, –) are zero but for rounding.
const ZERO: f64 = 1e-6;

/// One trial run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepTrial {
    /// Its step (s).
    pub time_step_s: f64,
    /// Its friction model.
    pub friction: &'static str,
    /// The measure that is compared; absent for `trajectory`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Relative change from twice the step, if there is a run of that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub change: Option<f64>,
    /// Why it gave no result.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

/// How a time step was chosen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepChoice {
    /// The step (s).
    pub time_step_s: f64,
    /// What was compared: a measure's name, or `trajectory` for all nodes over all records.
    pub measure: String,
    /// Largest of the relative changes below.
    pub change: f64,
    /// Largest change that was allowed.
    pub asked: f64,
    /// From four times the step to twice, and from twice to the step.
    pub halvings: [f64; 2],
    /// From the step to an eighth of it.
    pub to_an_eighth: f64,
    /// From the convex model of friction to Coulomb's law at the same step; absent with Coulomb's law and where nothing touches a floor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub other_friction: Option<f64>,
    /// All trial runs, each over the whole duration.
    pub trials: Vec<StepTrial>,
}

/// What a trial run gives to compare.
enum Seen {
    Value(f64),
    /// Places of the nodes (cm) in all records, and how many numbers a record has.
    Path(Vec<f64>, usize),
}

/// Trial runs by friction model, each by the number of halvings of its step.
struct Trials<'a> {
    at: &'a dyn Fn(f64, Option<FrictionModel>, f64) -> Result<Experiment, Trouble>,
    measure: Option<&'a str>,
    duration: f64,
    coarsest: f64,
    steps: u64,
    done: BTreeMap<(bool, usize), Result<Seen, String>>,
}

/// Why a search ends without a step.
enum End {
    Trouble(Trouble),
    Budget,
}

/// Chooses the step of a config with `time_step_s = "auto"` and resolves it with that step. The whole run is simulated with steps of 1 ms,
/// 0.5 ms and so on, until at most `step_error` is changed by the last two halvings and by an eighth of the step and, with the convex model of
/// friction on a floor, at most that and 1 % by Coulomb's law. Compared is the named measure, relative to itself, or the path of all nodes (root of the
/// mean square) relative to how far they go.
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
    let at = |step: f64, friction: Option<FrictionModel>, record: Option<f64>| {
        let mut config = config.clone();
        let s = &mut config.simulation;
        (s.step_error, s.step_measure) = (None, None);
        s.time_step_s = Some(StepConfig::Seconds(step));
        if let Some(friction) = friction {
            s.friction = Some(name_of(friction).into());
        }
        if record.is_some() {
            (s.record_every_s, s.record_every_steps, s.record_from_step) = (record, None, None);
        }
        resolve(&config)
    };
    // Checks everything else.
    let checked = at(COARSEST.min(duration), None, Some(duration))?;
    if !trials {
        return Ok(checked);
    }
    let ours = checked.friction;
    let other = (robot.mount == Mount::Ground && ours == FrictionModel::Convex).then_some(FrictionModel::Coulomb);
    let mut trials = Trials {
        at: &|step, friction, record| at(step, friction, Some(record)),
        measure: s.step_measure.as_deref(),
        duration,
        coarsest: duration / (duration / COARSEST).ceil(),
        steps: 0,
        done: BTreeMap::new(),
    };
    match trials.search(ours, other, asked) {
        Ok(Some(mut choice)) => {
            let mut experiment = at(choice.time_step_s, None, None)?;
            choice.time_step_s = experiment.time_step;
            experiment.step_choice = Some(choice);
            experiment.config = config.clone();
            Ok(experiment)
        }
        Ok(None) => Err(trials.not_converged(asked, "no step of 1e-7 s or more keeps it")),
        Err(End::Budget) => Err(trials.not_converged(asked, &format!("finer steps would take more than {BUDGET} in all to try"))),
        Err(End::Trouble(trouble)) => Err(trouble),
    }
}

fn name_of(friction: FrictionModel) -> &'static str {
    match friction {
        FrictionModel::Convex => "convex",
        FrictionModel::Coulomb => "coulomb",
    }
}

impl Trials<'_> {
    fn step(&self, level: usize) -> f64 {
        self.coarsest / (1_u64 << level) as f64
    }

    fn budget(&self) -> u64 {
        BUDGET.max(BUDGET_RUNS * (self.duration / self.coarsest) as u64)
    }

    fn search(&mut self, ours: FrictionModel, other: Option<FrictionModel>, asked: f64) -> Result<Option<StepChoice>, End> {
        let coarsest = self.coarsest;
        for level in (0..).take_while(|level| coarsest / (1_u64 << level) as f64 > FINEST) {
            self.run(ours, level)?;
            let Some(before) = level.checked_sub(2) else { continue };
            let Some(halvings) = self.change(ours, before, before + 1).zip(self.change(ours, before + 1, level)) else {
                continue;
            };
            if halvings.0.max(halvings.1) > asked {
                continue;
            }
            let mut other_friction = None;
            if let Some(other) = other {
                self.run(other, level)?;
                other_friction = self.difference((ours, level), (other, level));
                if other_friction.is_none_or(|difference| difference > asked.min(MODELS)) {
                    continue;
                }
            }
            self.run(ours, level + FAR)?;
            let Some(far) = self.change(ours, level, level + FAR).filter(|far| *far <= asked) else { continue };
            return Ok(Some(StepChoice {
                time_step_s: self.step(level),
                measure: self.measure.unwrap_or("trajectory").into(),
                change: halvings.0.max(halvings.1).max(far).max(other_friction.unwrap_or(0.0)),
                asked,
                halvings: [halvings.0, halvings.1],
                to_an_eighth: far,
                other_friction,
                trials: self.table(),
            }));
        }
        Ok(None)
    }

    /// Does a trial run unless it is done.
    fn run(&mut self, friction: FrictionModel, level: usize) -> Result<(), End> {
        let key = (friction == FrictionModel::Coulomb, level);
        if self.done.contains_key(&key) {
            return Ok(());
        }
        let step = self.step(level);
        self.steps += (self.duration / step) as u64;
        if self.steps > self.budget() {
            return Err(End::Budget);
        }
        let every = (self.duration / self.coarsest / RECORDS).ceil() * self.coarsest;
        let trial = (self.at)(step, Some(friction), every).map_err(End::Trouble)?;
        // A step that is too coarse for the robot may fail; a finer one need not.
        let run = trial.engine().and_then(|mut engine| run(&trial, engine.as_mut(), |_| Control::Continue));
        let seen = match run {
            Err(error) => Err(error.to_string()),
            Ok(run) => match (run.trouble(&trial).pop(), self.measure) {
                (Some(trouble), _) => Err(trouble),
                (None, None) => Ok(Seen::Path(run.recording.positions, 3 * (trial.robot.joints() + 2))),
                (None, Some(name)) => {
                    let value = run.measures.get(name).ok_or_else(|| {
                        let reason = format!("{name} cannot be had from the {} s of this experiment", self.duration);
                        End::Trouble(Fault::new("simulation.step_measure", reason).into())
                    })?;
                    Ok(Seen::Value(value))
                }
            },
        };
        self.done.insert(key, seen);
        Ok(())
    }

    fn change(&self, friction: FrictionModel, coarse: usize, fine: usize) -> Option<f64> {
        self.difference((friction, coarse), (friction, fine))
    }

    /// Relative difference of two trial runs, if both gave a result.
    fn difference(&self, coarse: (FrictionModel, usize), fine: (FrictionModel, usize)) -> Option<f64> {
        let seen = |(friction, level)| self.done.get(&(friction == FrictionModel::Coulomb, level))?.as_ref().ok();
        Some(match (seen(coarse)?, seen(fine)?) {
            (Seen::Value(a), Seen::Value(b)) if a.abs().max(b.abs()) < ZERO => 0.0,
            (Seen::Value(a), Seen::Value(b)) => ((a - b) / b).abs(),
            (Seen::Path(a, width), Seen::Path(b, _)) => path_change(a, b, *width),
            _ => return None,
        })
    }

    fn table(&self) -> Vec<StepTrial> {
        let row = |(&(coulomb, level), seen): (&(bool, usize), &Result<Seen, String>)| {
            let friction = if coulomb { FrictionModel::Coulomb } else { FrictionModel::Convex };
            StepTrial {
                time_step_s: self.step(level),
                friction: name_of(friction),
                value: if let Ok(Seen::Value(value)) = seen { Some(*value) } else { None },
                change: level.checked_sub(1).and_then(|twice| self.change(friction, twice, level)),
                failed: seen.as_ref().err().cloned(),
            }
        };
        self.done.iter().map(row).collect()
    }

    fn not_converged(&self, asked: f64, reason: &str) -> Trouble {
        let mut text = format!("the {} is not converged to {asked:e}: {reason}.", self.measure.unwrap_or("trajectory"));
        let table = self.table();
        for friction in ["convex", "coulomb"] {
            let mut rows = table.iter().filter(|row| row.friction == friction).peekable();
            if rows.peek().is_none() {
                continue;
            }
            let _ = write!(text, " With friction = \"{friction}\"");
            for (index, row) in rows.enumerate() {
                let separator = if index == 0 { ": " } else { "; " };
                let _ = write!(text, "{separator}{:.2e} s", row.time_step_s);
                let _ = match (row.value, row.change, &row.failed) {
                    (Some(value), ..) => write!(text, " {value:.5}"),
                    (_, Some(change), _) => write!(text, " changes by {change:.1e}"),
                    (.., Some(_)) => write!(text, " failed"),
                    _ => Ok(()),
                };
            }
            text.push('.');
        }
        text.push_str(
            " Try a larger simulation.step_error, a step_measure that depends less on each impact, a shorter duration_s or less friction, \
             or set time_step_s yourself and compare with finer ones",
        );
        Trouble::Config(ConfigError::NotConverged(text))
    }
}

/// Root mean square distance of all nodes in all records, of so many numbers each, relative to that of their travel.
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
