//! `[ensemble]`: one experiment run many times with small perturbations, and what its measures have in common.
//!
//! Contact makes the motion of some robots chaotic: a result then means something only with its spread. Member 0 is the experiment as it is written. The
//! perturbations of the others follow from the seed, the member's number and the key alone, so they depend neither on threads nor on other keys.

use std::collections::BTreeMap;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use toml::Value;

use super::config::Fault;
use super::{Config, ConfigError, Control, Experiment, Setting, Source, experiment, line_of, run};
use crate::files;
use crate::keys;
use crate::recording::measures::Measures;
use crate::words::number;

/// Largest number of members.
const MOST_MEMBERS: usize = 10_000;

/// `[ensemble]`.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct EnsembleConfig {
    /// Number of runs; the first is the experiment as it is written.
    pub members: usize,
    /// Seed of the perturbations.
    #[serde(default)]
    pub seed: u64,
    /// Perturbed keys: [ensemble.vary].
    pub vary: BTreeMap<String, PerturbationConfig>,
}

/// How one key differs from member to member; exactly one of these.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct PerturbationConfig {
    /// Standard deviation of a normal distribution, in the unit of the key.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sd: Option<f64>,
    /// Standard deviation as a share of the key's value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative: Option<f64>,
    /// Values that the members take by turns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<Value>>,
}

/// A measure over the members.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Standard deviation, with n − 1.
    pub sd: f64,
    /// Quantiles of 5, 50 and 95 %, linear between the sorted values (Hyndman and Fan 1996, definition 7).
    pub q05: f64,
    /// Median.
    pub q50: f64,
    /// 95 %.
    pub q95: f64,
}

impl Spread {
    /// What stands before a measure's name in the columns of a sweep.
    pub const PREFIXES: [&'static str; 5] = ["mean_", "sd_", "q05_", "q50_", "q95_"];

    /// Of at least one value.
    pub fn of(values: &[f64]) -> Self {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let quantile = |p: f64| {
            let at = p * (count - 1.0);
            let (below, above) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
            below + at.fract() * (above - below)
        };
        let sd = if count > 1.0 { (squares / (count - 1.0)).sqrt() } else { 0.0 };
        Self { mean, sd, q05: quantile(0.05), q50: quantile(0.5), q95: quantile(0.95) }
    }

    /// In the order of [`PREFIXES`](Self::PREFIXES).
    pub fn values(&self) -> [f64; 5] {
        [self.mean, self.sd, self.q05, self.q50, self.q95]
    }
}

/// The experiments of an ensemble, the unperturbed one first; it alone without `[ensemble]`.
///
/// # Errors
/// [`ConfigError`] for an `[ensemble]` that is none, or if a perturbed experiment is invalid.
pub fn members(source: &Source) -> Result<Vec<Experiment>, ConfigError> {
    let config = source.parse()?;
    let first = experiment(source)?;
    let Some(ensemble) = &config.ensemble else { return Ok(vec![first]) };
    let checked = perturbations(&config, ensemble, &first).map_err(|Fault { key, message }| {
        let parts = if key.contains('.') { vec!["ensemble", "vary", &key] } else { vec!["ensemble", &key] };
        let line = line_of(source.text(), parts.iter().copied());
        let place = line.map_or_else(|| source.name.clone(), |line| format!("{}, line {line}", source.name));
        let key = if key.contains('.') { format!("ensemble.vary.\"{key}\"") } else { format!("ensemble.{key}") };
        ConfigError::Value { place, key, message }
    })?;
    let member = |index: usize| {
        let mut source = source.clone();
        for perturbation in &checked {
            let value = perturbation.value(ensemble.seed, index);
            let place = format!("member {index} of the ensemble, {} = {value}", perturbation.key);
            source.push(Setting { key: perturbation.key.to_owned(), value: value.to_string(), place });
        }
        experiment(&source)
    };
    (0..ensemble.members).map(member).collect()
}

/// The perturbation of one key.
struct Perturbation<'a> {
    key: &'a str,
    base: Value,
    config: &'a PerturbationConfig,
}

impl Perturbation<'_> {
    /// The key's value in a member.
    fn value(&self, seed: u64, member: usize) -> Value {
        if let Some(values) = &self.config.values {
            return values[member % values.len()].clone();
        }
        if member == 0 {
            return self.base.clone();
        }
        let mut start = [0; 32];
        start[..8].copy_from_slice(&seed.to_le_bytes());
        start[8..].iter_mut().zip(files::digest(self.key.as_bytes()).bytes()).for_each(|(to, byte)| *to = byte);
        let mut random = ChaCha8Rng::from_seed(start);
        random.set_stream(member as u64);
        let mut perturbed = |base: f64| {
            let z: f64 = StandardNormal.sample(&mut random);
            Value::Float(
                self.config.relative.map_or(base, |relative| base * (1.0 + relative * z)) + self.config.sd.unwrap_or(0.0) * z,
            )
        };
        match &self.base {
            Value::Array(list) => Value::Array(list.iter().map(|value| perturbed(float(value).unwrap_or(0.0))).collect()),
            value => perturbed(float(value).unwrap_or(0.0)),
        }
    }
}

fn float(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|value| value as f64))
}

/// The perturbations, checked. A fault's key has dots if it is one of `vary`.
fn perturbations<'a>(config: &Config, ensemble: &'a EnsembleConfig, first: &Experiment) -> Result<Vec<Perturbation<'a>>, Fault> {
    if !(2..=MOST_MEMBERS).contains(&ensemble.members) {
        return Err(Fault::new("members", format!("is {}, but must be from 2 to {MOST_MEMBERS}", ensemble.members)));
    }
    if ensemble.vary.is_empty() {
        return Err(Fault::new("vary", "is empty; name the keys to perturb"));
    }
    let whole = Value::try_from(config).map_err(|error| Fault::new("vary", error.to_string()))?;
    let perturbation = |(key, config): (&'a String, &'a PerturbationConfig)| {
        let fault = |message: String| Fault::new(key.as_str(), message);
        if !key.contains('.') || key.starts_with("ensemble.") {
            return Err(Fault::new("vary", format!("{key} is no key of the experiment with its table, as robot.friction.low")));
        }
        let base = match (config.sd, config.relative, &config.values) {
            (None, None, Some(values)) if !values.is_empty() => Value::Boolean(false),
            (None, None, Some(_)) => return Err(fault("has no values".into())),
            (Some(width), None, None) | (None, Some(width), None) => {
                if !(width.is_finite() && width >= 0.0) {
                    return Err(fault(format!(
                        "has a standard deviation of {}, but must have one of zero or more",
                        number(width)
                    )));
                }
                base(&whole, key, first).ok_or_else(|| {
                    fault("has no value to perturb that is a number or a list of numbers; give one in the experiment".into())
                })?
            }
            _ => return Err(fault("needs exactly one of sd, relative and values".into())),
        };
        Ok(Perturbation { key, base, config })
    };
    ensemble.vary.iter().map(perturbation).collect()
}

/// The value of a key as it is given, or else its default.
fn base(config: &Value, key: &str, first: &Experiment) -> Option<Value> {
    let given = key.split('.').try_fold(config, |at, part| at.get(part)).cloned();
    let default = || match key {
        "simulation.joint_angles_rad" => Some(Value::Array(vec![Value::Float(0.0); first.robot.joints()])),
        _ => {
            let material = config.get("material").and_then(|material| material.get("preset")).and_then(Value::as_str);
            let text = keys::default_of(key, material == Some("parameter-4"))?;
            toml::from_str::<toml::Table>(&format!("v = {text}")).ok()?.remove("v")
        }
    };
    let is_number = |value: &Value| float(value).is_some();
    given.or_else(default).filter(|value| is_number(value) || value.as_array().is_some_and(|list| list.iter().all(is_number)))
}

/// Runs the members on the threads of the current pool; `None` if `given_up` said so.
///
/// # Errors
/// Why the first member that failed, or had [trouble](super::Run::trouble), gives no measures.
pub fn run_members(members: &[Experiment], given_up: &(impl Fn() -> bool + Sync)) -> Result<Option<Vec<Measures>>, String> {
    let observe = |_| if given_up() { Control::Stop } else { Control::Continue };
    let one = |(index, member): (usize, &Experiment)| -> Result<Option<Measures>, String> {
        let failed = |reason: String| if members.len() == 1 { reason } else { format!("member {index}: {reason}") };
        let mut engine = member.engine().map_err(|error| failed(error.to_string()))?;
        let run = run(member, engine.as_mut(), observe).map_err(|error| failed(error.to_string()))?;
        if run.interrupted {
            return Ok(None);
        }
        match run.trouble(member).into_iter().next() {
            Some(trouble) => Err(failed(trouble)),
            None => Ok(Some(run.measures)),
        }
    };
    let results: Vec<_> = members.par_iter().enumerate().with_max_len(1).map(one).collect();
    results.into_iter().collect()
}

/// A measure over the members; `None` if one of them has none.
pub fn spread(measures: &[Measures], name: &str) -> Option<Spread> {
    let values: Option<Vec<f64>> = measures.iter().map(|measures| measures.get(name)).collect();
    values.filter(|values| !values.is_empty()).map(|values| Spread::of(&values))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[robot]\nactuators = 2\nmotors_per_actuator = 1\nmount = \"clamped\"\n[drive]\nwaveform = \"dc\"\nvoltages_v = [0, -500]\n\
        [simulation]\nengine = \"planar\"\ntime_step_s = 1e-3\nsteps = 5\n[ensemble]\nmembers = 400\nseed = 3\n[ensemble.vary]\n";

    fn ensemble(vary: &str) -> Result<Vec<Experiment>, ConfigError> {
        members(&Source::from_text("e.toml", format!("{TEXT}{vary}")))
    }

    #[test]
    fn members_scatter_as_asked_around_the_first_which_is_the_experiment() {
        let all = ensemble(
            "\"robot.damping_eta\" = { relative = 0.1 }\n\"drive.voltages_v\" = { sd = 20 }\n\
             \"simulation.joint_angles_rad\" = { sd = 1e-3 }\n\"simulation.steps\" = { values = [5, 7] }\n",
        )
        .unwrap();
        assert_eq!((all.len(), all[0].robot.damping.eta(), &all[0].joint_angles[..]), (400, 0.045, &[0.0, 0.0][..]));
        assert_eq!([all[0].steps, all[1].steps, all[2].steps], [5, 7, 5]);
        // Of 400 normal numbers mean and standard deviation are known to 5 and 3.5 %: three times that.
        let damping = Spread::of(&all.iter().map(|member| member.robot.damping.eta()).collect::<Vec<_>>());
        assert!((damping.mean - 0.045).abs() < 3.0 * 0.05 * 0.0045, "{damping:?}");
        assert!((damping.sd / 0.0045 - 1.0).abs() < 3.0 * 0.035, "{damping:?}");
        for (joint, other) in [(0, 1), (1, 0)] {
            let angles = |joint: usize| all.iter().skip(1).map(move |member| 1e3 * member.joint_angles[joint]);
            assert!((Spread::of(&angles(joint).collect::<Vec<_>>()).sd - 1.0).abs() < 0.11);
            let product = angles(joint).zip(angles(other)).map(|(a, b)| a * b).sum::<f64>() / 399.0;
            assert!(product.abs() < 0.15, "joints are perturbed independently: {product}");
        }
    }

    #[test]
    fn a_perturbation_depends_on_seed_key_and_member_alone() {
        let damping = |vary: &str, text: &str| {
            let all = members(&Source::from_text("e.toml", format!("{text}{vary}"))).unwrap();
            all.iter().map(|member| member.robot.damping.eta()).collect::<Vec<_>>()
        };
        let alone = damping("\"robot.damping_eta\" = { relative = 0.1 }\n", TEXT);
        assert_eq!(alone, damping("\"robot.friction.low\" = { sd = 0.01 }\n\"robot.damping_eta\" = { relative = 0.1 }\n", TEXT));
        assert_eq!(alone[..9], damping("\"robot.damping_eta\" = { relative = 0.1 }\n", &TEXT.replace("400", "9")));
        assert_ne!(alone[1], damping("\"robot.damping_eta\" = { relative = 0.1 }\n", &TEXT.replace("seed = 3", "seed = 4"))[1]);
    }

    #[test]
    fn quantiles_are_linear_between_the_sorted_values() {
        let spread = Spread::of(&[4.0, 1.0, 3.0, 2.0, 5.0]);
        assert_eq!((spread.mean, spread.q50, spread.q05, spread.q95), (3.0, 3.0, 1.2, 4.8));
        assert!((spread.sd - 2.5_f64.sqrt()).abs() < 1e-15);
        assert_eq!(Spread::of(&[2.0]).values(), [2.0, 0.0, 2.0, 2.0, 2.0]);
    }

    #[test]
    fn whatever_is_no_ensemble_is_refused_with_line_and_key() {
        for (vary, words) in [
            ("", vec!["line 15", "ensemble.vary", "empty"]),
            ("\"robot.legs\" = { sd = 1 }", vec!["line 16", "robot.legs", "no value to perturb"]),
            ("\"robot.mount\" = { sd = 1 }", vec!["line 16", "robot.mount", "number"]),
            ("\"robot.damping_eta\" = { sd = 1, relative = 1 }", vec!["line 16", "exactly one"]),
            ("\"robot.damping_eta\" = {}", vec!["line 16", "exactly one"]),
            ("\"robot.damping_eta\" = { sd = -1 }", vec!["line 16", "-1", "zero or more"]),
            ("\"robot.damping_eta\" = { values = [] }", vec!["line 16", "no values"]),
            ("\"robot.damping_eta\" = { relative = 5 }", vec!["member", "robot.damping_eta", "zero or more"]),
            ("damping = { sd = 1 }", vec!["vary", "damping", "table"]),
            ("\"robot.damping_eta\" = { width = 1 }", vec!["width"]),
        ] {
            let error = ensemble(vary).unwrap_err().to_string();
            assert!(words.iter().all(|word| error.contains(word)), "{vary}: {error}");
        }
        let one = TEXT.replace("400", "1");
        let error = members(&Source::from_text("e.toml", format!("{one}\"robot.damping_eta\" = {{ sd = 0.001 }}"))).unwrap_err();
        assert!(error.to_string().contains("from 2 to"), "{error}");
    }
}
