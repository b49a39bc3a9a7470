//! The constants that are searched, and experiments with their values.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Value;

use super::super::DiagnoseError;
use super::super::dataset::Observation;
use super::super::observations::config;
use crate::effects::{self, EFFECTS};
use crate::experiment::{self, Config, Control, EffectConfig, EffectValue, Experiment, Setting, Source};
use crate::words::number;

/// Most combinations of constants that are searched by their values.
const MOST_LEVELS: usize = 64;
/// Most constants.
const MOST_CONSTANTS: usize = 10;
/// A range whose ends have this ratio or more is searched by ratios.
const WIDE: f64 = 2.0;

/// `[identify]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identify {
    /// Seed of the search.
    #[serde(default)]
    pub seed: u64,
    /// The constants: [identify.vary].
    pub vary: BTreeMap<String, Searched>,
}

/// How one constant is searched.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Searched {
    /// Least value.
    pub from: Option<f64>,
    /// Largest value.
    pub to: Option<f64>,
    /// The only possible values, in place of a range.
    pub values: Option<Vec<f64>>,
}

/// A constant with a range.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnose) struct Constant {
    pub key: String,
    from: f64,
    to: f64,
}

impl Constant {
    fn is_ratio(&self) -> bool {
        self.from > 0.0 && self.to / self.from >= WIDE
    }

    /// The value at a coordinate from 0 to 1.
    pub fn value(&self, x: f64) -> f64 {
        if self.is_ratio() { self.from * (self.to / self.from).powf(x) } else { self.from + x * (self.to - self.from) }
    }
}

/// A point of the search: which values the constants without a range have, and the coordinates of the others from 0 to 1.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnose) struct Point {
    pub level: usize,
    pub x: Vec<f64>,
}

/// What is searched: constants with a range, and all combinations of those with values.
#[derive(Debug, Clone)]
pub(in crate::diagnose) struct Space {
    pub constants: Vec<Constant>,
    /// Keys of the constants with values.
    pub listed: Vec<String>,
    /// Their values in every combination.
    pub levels: Vec<Vec<f64>>,
}

impl Space {
    /// Checks `[identify]`; the error is a key of `vary`, or none, and what is wrong.
    pub fn new(identify: &Identify) -> Result<Self, (Option<String>, String)> {
        if identify.vary.is_empty() {
            return Err((None, "names no constants to search".into()));
        }
        if identify.vary.len() > MOST_CONSTANTS {
            return Err((None, format!("names {} constants; at most {MOST_CONSTANTS} are possible", identify.vary.len())));
        }
        let mut space = Self { constants: Vec::new(), listed: Vec::new(), levels: vec![Vec::new()] };
        for (key, searched) in &identify.vary {
            let wrong = |message: String| Err((Some(key.clone()), message));
            if !key.contains('.') {
                return wrong("is no key of an experiment with its table, as robot.friction.low".into());
            }
            match (searched.from, searched.to, &searched.values) {
                (Some(from), Some(to), None) if from.is_finite() && to.is_finite() && from < to => {
                    space.constants.push(Constant { key: key.clone(), from, to });
                }
                (Some(from), Some(to), None) => return wrong(format!("goes from {} to {}", number(from), number(to))),
                (None, None, Some(values)) if !values.is_empty() && values.iter().all(|value| value.is_finite()) => {
                    space.listed.push(key.clone());
                    let with = |level: &Vec<f64>| values.iter().map(|value| [&level[..], &[*value]].concat()).collect::<Vec<_>>();
                    space.levels = space.levels.iter().flat_map(with).collect();
                }
                _ => return wrong("needs from and to, or values".into()),
            }
        }
        if space.levels.len() > MOST_LEVELS {
            return Err((None, format!("has {} combinations of values; at most {MOST_LEVELS} are possible", space.levels.len())));
        }
        Ok(space)
    }

    /// Keys and values at a point.
    pub fn settings<'a>(&'a self, point: &'a Point) -> impl Iterator<Item = (&'a str, f64)> {
        let ranged = self.constants.iter().zip(&point.x).map(|(constant, x)| (constant.key.as_str(), constant.value(*x)));
        ranged.chain(self.listed.iter().map(String::as_str).zip(self.levels[point.level].iter().copied()))
    }

    /// The experiment of an observation at a point.
    pub fn experiment(&self, nominal: &Config, observation: &Observation, point: &Point) -> Result<Experiment, DiagnoseError> {
        let mut config = config(nominal, observation)?;
        for (key, value) in self.settings(point) {
            if let Some((id, parameter)) = key.strip_prefix("effect.").and_then(|rest| rest.split_once('.')) {
                set_effect(&mut config, id, parameter, value);
            }
        }
        let text = toml::to_string(&config).map_err(|error| DiagnoseError::from(error.to_string()))?;
        let mut source = Source::from_text(&observation.measure, text);
        for (key, value) in self.settings(point).filter(|(key, _)| !key.starts_with("effect.")) {
            source.push(Setting { key: key.into(), value: format!("{value:?}"), place: format!("{key} = {value}") });
        }
        Ok(experiment::experiment(&source)?)
    }

    /// What an observation would be at a point, with time steps of one length divided by `finer`; `None` if the run gives no measure.
    pub fn predict(&self, nominal: &Config, observation: &Observation, point: &Point, finer: u64) -> Option<f64> {
        let mut experiment = self.experiment(nominal, observation, point).ok()?;
        if experiment.accuracy.is_none() {
            experiment.time_step /= finer as f64;
            for steps in [&mut experiment.steps, &mut experiment.record_every, &mut experiment.record_from] {
                *steps *= finer;
            }
        }
        experiment.record_only_what_measures_need(&[&observation.measure]);
        let mut engine = experiment.engine().ok()?;
        let run = experiment::run(&experiment, engine.as_mut(), |_| Control::Continue).ok()?;
        if !run.trouble(&experiment).is_empty() {
            return None;
        }
        run.measures.get(&observation.measure)
    }

    /// Checks that every observation is a valid experiment in the middle and at the ends of all ranges; the error has the constant's key.
    pub fn check(&self, nominal: &Config, observations: &[Observation]) -> Result<(), (Option<String>, String)> {
        for key in self.constants.iter().map(|constant| &constant.key).chain(&self.listed) {
            if let Some(rest) = key.strip_prefix("effect.") {
                let known = rest.split_once('.').and_then(|(id, name)| {
                    let effect = effects::find(id)?;
                    effect.parameters.iter().find(|parameter| parameter.name == name)
                });
                if known.is_none() {
                    let ids: Vec<&str> = EFFECTS.iter().map(|effect| effect.id).collect();
                    let message = format!("is no effect.ID.PARAMETER of an effect; effects are {}", ids.join(", "));
                    return Err((Some(key.clone()), message));
                }
            }
        }
        let middle = vec![0.5; self.constants.len()];
        for (at, constant) in self.constants.iter().enumerate() {
            for end in [0.0, 1.0] {
                let mut x = middle.clone();
                x[at] = end;
                self.check_point(nominal, observations, &Point { level: 0, x })
                    .map_err(|error| (Some(constant.key.clone()), error))?;
            }
        }
        for level in 0..self.levels.len() {
            let point = Point { level, x: middle.clone() };
            self.check_point(nominal, observations, &point).map_err(|error| (self.listed.first().cloned(), error))?;
        }
        Ok(())
    }

    fn check_point(&self, nominal: &Config, observations: &[Observation], point: &Point) -> Result<(), String> {
        let valid = |observation: &Observation| self.experiment(nominal, observation, point).map(drop);
        observations.iter().try_for_each(valid).map_err(|error| error.to_string())
    }
}

/// Sets one parameter of an effect, in its table or in a new one.
fn set_effect(config: &mut Config, id: &str, parameter: &str, value: f64) {
    let table = match config.effect.iter_mut().position(|table| table.id == id) {
        Some(at) => &mut config.effect[at],
        None => {
            config.effect.push(EffectConfig { id: id.into(), ..EffectConfig::default() });
            let last = config.effect.len() - 1;
            &mut config.effect[last]
        }
    };
    table.parameters.insert(parameter.into(), EffectValue::Number(value));
}

/// An experiment file with the constants of a point, driven as an observation.
pub(super) fn file(space: &Space, nominal: &Config, observation: &Observation, point: &Point) -> Result<String, DiagnoseError> {
    let experiment = space.experiment(nominal, observation, point)?;
    let value = Value::try_from(&experiment.config).map_err(|error| DiagnoseError::from(error.to_string()))?;
    toml::to_string(&value).map_err(|error| error.to_string().into())
}
