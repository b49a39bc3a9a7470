//! What was identified: ranges, ties, what decides, what the rest foretells, and what to measure next.

use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use serde::Serialize;

use super::super::DiagnoseError;
use super::super::dataset::{Dataset, Observation};
use super::super::observations::setting;
use super::confirm::{self, Confirmed};
use super::constants::{self, Point};
use super::emulator::Emulator;
use super::profile::{Likelihood, RANGE};
use super::{Found, Run, Search};
use crate::experiment::Spread;
use crate::number::signed;
use crate::words::split_unit;

/// Correlation from which on two constants are tied.
const TIED: f64 = 0.9;
/// Runs from the likely constants for a prediction.
const DRAWS: usize = 24;
/// Most settings that are compared as next measurements.
const MOST_PROPOSALS: usize = 24;
/// Information of constants that nothing decides, per square of their whole range.
const LEAST_INFORMATION: f64 = 12.0;

/// The result of an identification.
#[derive(Debug, Clone, Serialize)]
pub struct Identification {
    /// Version of this form.
    pub schema: u32,
    /// Name of the data set.
    pub dataset: String,
    /// The result in sentences.
    pub summary: String,
    /// True if the confirmed constants meet every number: the means over an ensemble are as near as noise alone leaves all of them with 95 %.
    pub meets_all: bool,
    /// The constants that were simulated as an ensemble and come closest.
    pub confirmed: Vec<(String, f64)>,
    /// True if there are fewer numbers than constants, or the ranges of some constants end at those of the search: the answer is a set.
    pub is_set: bool,
    /// Residuals over their standard deviations, rms.
    pub misfit_sigma: f64,
    /// The constants with a range.
    pub constants: Vec<Identified>,
    /// The constants with a list of values.
    pub listed: Vec<Listed>,
    /// The numbers.
    pub facts: Vec<Fact>,
    /// The constants at both ends of every range.
    pub corners: Vec<Corner>,
    /// Settings of similar measurements, the best first.
    pub next: Vec<Proposal>,
    /// Number of constant sets that were simulated.
    pub simulated: usize,
    /// What is to be known of the result.
    pub remarks: Vec<String>,
    /// An experiment file with the best constants.
    #[serde(skip)]
    pub file: String,
}

/// A constant with its range.
#[derive(Debug, Clone, Serialize)]
pub struct Identified {
    /// Its key.
    pub key: String,
    /// Its best value.
    pub value: f64,
    /// Its 95 % range by the profile likelihood; none if the best constants miss the numbers by more than noise.
    pub range95: Option<[f64; 2]>,
    /// Whether an end of that is one of the search.
    pub at_bound: [bool; 2],
    /// Other constants with a correlation of 0.9 or more, with it.
    pub tied_with: Vec<(String, f64)>,
}

/// A constant that has one of some values.
#[derive(Debug, Clone, Serialize)]
pub struct Listed {
    /// Its key.
    pub key: String,
    /// Its best value.
    pub value: f64,
    /// All that are possible at 95 %; none where there are no ranges either.
    pub possible: Vec<f64>,
}

/// A measured number.
#[derive(Debug, Clone, Serialize)]
pub struct Fact {
    /// Its measure.
    pub measure: String,
    /// What it was measured under.
    pub setting: String,
    /// Frequency of the drive (Hz).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency_hz: Option<f64>,
    /// False if it was to be foretold only.
    pub is_fitted: bool,
    /// The measured value.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// The prediction: with the best constants, or of the likely ones if it was to be foretold.
    pub predicted: f64,
    /// Standard deviation of predictions: the scatter of the motion, and of a foretold number also the uncertainty of the constants.
    pub scatter: f64,
    /// Distance of both over their standard deviations together.
    pub off_sigma: f64,
    /// With the confirmed constants: mean and standard deviation over an ensemble of eight close by, and the distance of the measured value from that mean over the
    /// standard deviation of both.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confirmed: Option<[f64; 3]>,
    /// What the other numbers foretell, with its standard deviation and the distance over both.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from_others: Option<[f64; 3]>,
    /// Factor by which the ranges of all constants are wider without it, geometric mean.
    pub decides: f64,
}

/// The constants where one of them is at an end of its range.
#[derive(Debug, Clone, Serialize)]
pub struct Corner {
    /// Which end of which constant.
    pub of: String,
    /// All constants there.
    pub values: Vec<(String, f64)>,
}

/// A setting that was not measured.
#[derive(Debug, Clone, Serialize)]
pub struct Proposal {
    /// The measure.
    pub measure: String,
    /// Frequency of the drive (Hz).
    pub frequency_hz: f64,
    /// Standard deviation of its prediction by the uncertainty of the constants.
    pub uncertain_by: f64,
    /// What scatters about that: motion and measurement.
    pub scatter: f64,
}

/// The likely constants about the best of one combination.
struct Likely<'a> {
    found: &'a Found,
    /// Covariance of the coordinates.
    covariance: DMatrix<f64>,
}

impl<'a> Likely<'a> {
    fn new(search: &Search, found: &'a Found, without: Option<usize>) -> Option<Self> {
        let likelihood = Likelihood { emulator: &found.emulator, observed: &search.observed, without };
        let count = found.best.0.len();
        let information = likelihood.information(&found.best.0) + DMatrix::identity(count, count) * LEAST_INFORMATION;
        Some(Self { found, covariance: information.try_inverse()? })
    }

    /// Coordinates at the best and about it.
    fn draws(&self, random: &mut ChaCha8Rng) -> Vec<Point> {
        let count = self.found.best.0.len();
        let factor = self.covariance.clone().cholesky().map_or_else(|| DMatrix::zeros(count, count), |factors| factors.l());
        let draw = |random: &mut ChaCha8Rng| {
            let z = DVector::from_fn(count, |_, _| StandardNormal.sample(random));
            let x = &factor * z;
            let x = self.found.best.0.iter().zip(x.iter()).map(|(best, step)| (best + step).clamp(0.0, 1.0)).collect();
            Point { level: self.found.level, x }
        };
        (0..DRAWS).map(|_| draw(random)).collect()
    }

    /// Mean of what an observation would be with the likely constants, its standard deviation by them, and the scatter about that; `None` if most runs fail.
    fn foretell(&self, search: &Search, observation: &Observation, points: &[Point]) -> Option<[f64; 3]> {
        let values: Vec<Option<f64>> = points.par_iter().map(|point| search.predict(observation, point, 1)).collect();
        let there: Vec<(&Point, f64)> =
            points.iter().zip(&values).filter_map(|(point, value)| Some((point, (*value)?))).collect();
        let columns = self.found.best.0.len() + 1;
        if 2 * there.len() < points.len() || there.len() <= columns {
            return None;
        }
        // Straight lines part the constants' share from the scatter.
        let a = DMatrix::from_fn(there.len(), columns, |row, column| if column == 0 { 1.0 } else { there[row].0.x[column - 1] });
        let y = DVector::from_fn(there.len(), |row, _| there[row].1);
        let coefficients = a.clone().svd(true, true).solve(&y, 1e-9).ok()?;
        let fitted = a * coefficients;
        let scatter = ((&y - &fitted).norm_squared() / (there.len() - columns) as f64).sqrt();
        let spread = Spread::of(fitted.as_slice());
        Some([spread.mean, spread.sd, scatter])
    }
}

/// Builds the result from what was found for each hopeful combination, by `runs` and `fine` more with finer steps.
pub(super) fn results(
    search: &Search,
    dataset: &Dataset,
    found: &[Found],
    runs: &[Run],
    fine: usize,
) -> Result<Identification, DiagnoseError> {
    let Some(best) = found.first() else {
        return Err("no constants within the ranges give the measured numbers: every run fails, or most of them; widen [identify.vary], or simulate longer".into());
    };
    let space = search.space;
    let possible: Vec<&Found> = found.iter().filter(|found| found.best.1 <= best.best.1 + RANGE).collect();
    let mut remarks = Vec::new();
    if possible.iter().any(|found| !found.is_settled) {
        remarks.push("the region of likely constants still changed in the last wave: ranges are not converged".into());
    }
    for (observation, moved) in search.fitted.iter().zip(&best.moved) {
        if let Some(moved) = moved.filter(|moved| moved.abs() > observation.sigma) {
            let named = format!("{} ({})", observation.measure, setting(observation));
            remarks.push(format!(
                "{named} changes by {} from the given time step to a quarter of it, which the ranges are of",
                signed(moved, 3)
            ));
        }
    }
    let is_met = search.is_met(best);
    let (mut constants, mut corners) = constants_of(search, best, &possible);
    if !is_met {
        constants.iter_mut().for_each(|constant| (constant.range95, constant.at_bound) = (None, [false; 2]));
        corners.clear();
    }
    let listed = space.listed.iter().enumerate().map(|(at, key)| {
        let of = |found: &&Found| space.levels[found.level][at];
        let mut values: Vec<f64> = possible.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        if !is_met {
            values.clear();
        }
        Listed { key: key.clone(), value: space.levels[best.level][at], possible: values }
    });
    let likely = Likely::new(search, best, None).ok_or("the information matrix cannot be inverted")?;
    search.begin("confirming the best".into());
    let likely_points = possible.iter().map(|found| Point { level: found.level, x: found.best.0.clone() });
    let confirmed = search.confirmed(likely_points, runs).ok_or("no point can be confirmed")?;
    search.begin("predictions".into());
    let mut random = search.random(best.level, 900);
    let points = likely.draws(&mut random);
    let facts = facts(search, dataset, &likely, &points, &confirmed, &mut remarks);
    let next = proposals(search, &likely, &points);
    let fitted: Vec<&Fact> = facts.iter().filter(|fact| fact.is_fitted).collect();
    let misfit_sigma = (fitted.iter().map(|fact| fact.off_sigma.powi(2)).sum::<f64>() / fitted.len().max(1) as f64).sqrt();
    let fewer = search.fitted.len() < space.constants.len() + space.listed.len();
    let is_set = fewer || constants.iter().any(|constant: &Identified| constant.at_bound == [true, true]);
    if constants.iter().any(|constant| constant.at_bound.contains(&true)) {
        remarks.push("some ranges end where the search does; widen [identify.vary] to see more".into());
    }
    let last = search.fitted.last().copied().ok_or("there is nothing to fit")?;
    let file = constants::file(space, search.nominal, last, &confirmed.point)?;
    let mut result = Identification {
        schema: 1,
        dataset: dataset.name.clone(),
        summary: String::new(),
        meets_all: confirmed.meets_all(search),
        confirmed: space.settings(&confirmed.point).map(|(key, value)| (key.to_owned(), value)).collect(),
        is_set,
        misfit_sigma,
        constants,
        listed: listed.collect(),
        facts,
        corners,
        next,
        simulated: runs.len() + fine,
        remarks,
        file,
    };
    result.summary = summary(&result, search, &confirmed, fewer);
    Ok(result)
}

/// The constants with their ranges over all possible combinations, and the sets at their ends.
fn constants_of(search: &Search, best: &Found, possible: &[&Found]) -> (Vec<Identified>, Vec<Corner>) {
    let space = search.space;
    let correlations = Likely::new(search, best, None).map(|likely| likely.covariance);
    let mut corners = Vec::new();
    let mut constants = Vec::new();
    for (at, constant) in space.constants.iter().enumerate() {
        let mut range = [best.best.0[at]; 2];
        let mut ends: [Option<Point>; 2] = [None, None];
        for found in possible {
            let likelihood = Likelihood { emulator: &found.emulator, observed: &search.observed, without: None };
            // The same height for all combinations.
            let rise = RANGE - (found.best.1 - best.best.1);
            for (side, end) in likelihood.range(&found.best, at, rise).into_iter().enumerate() {
                let value = end.x[at];
                let is_further = if side == 0 { value <= range[0] } else { value >= range[1] };
                if is_further {
                    range[side] = value;
                    ends[side] = Some(Point { level: found.level, x: end.x });
                }
            }
        }
        for (end, point) in ["least", "largest"].into_iter().zip(ends).filter_map(|(end, point)| Some((end, point?))) {
            let values = space.settings(&point).map(|(key, value)| (key.to_owned(), value)).collect();
            corners.push(Corner { of: format!("{end} {}", constant.key), values });
        }
        let tied_with = correlations.iter().flat_map(|covariance| {
            let correlation =
                move |other: usize| covariance[(at, other)] / (covariance[(at, at)] * covariance[(other, other)]).sqrt();
            let others = (0..space.constants.len()).filter(move |other| *other != at);
            others.map(move |other| (space.constants[other].key.clone(), correlation(other)))
        });
        constants.push(Identified {
            key: constant.key.clone(),
            value: constant.value(best.best.0[at]),
            range95: Some(range.map(|x| constant.value(x))),
            at_bound: [range[0] <= 1e-6, range[1] >= 1.0 - 1e-6],
            tied_with: tied_with.filter(|(_, correlation)| correlation.abs() >= TIED).collect(),
        });
    }
    (constants, corners)
}

/// All numbers with what is predicted of them.
fn facts(
    search: &Search,
    dataset: &Dataset,
    likely: &Likely,
    points: &[Point],
    confirmed: &Confirmed,
    remarks: &mut Vec<String>,
) -> Vec<Fact> {
    let Found { emulator, best, .. } = likely.found;
    let fact = |observation: &Observation, is_fitted: bool| Fact {
        measure: observation.measure.clone(),
        setting: setting(observation),
        frequency_hz: frequency(observation),
        is_fitted,
        value: observation.value,
        sigma: observation.sigma,
        predicted: f64::NAN,
        scatter: f64::NAN,
        off_sigma: f64::NAN,
        confirmed: None,
        from_others: None,
        decides: 1.0,
    };
    let mut facts = Vec::new();
    for (at, observation) in search.fitted.iter().enumerate() {
        let mut fact = fact(observation, true);
        fact.confirmed = confirmed.spreads[at].map(|spread| [spread.mean, spread.sd, confirmed.off(search, at)]);
        let Some(surface) = &emulator.surfaces[at] else {
            remarks.push(format!("{} ({}) is left out: most runs do not give it", fact.measure, fact.setting));
            continue;
        };
        fact.predicted = emulator.at(surface, &best.0).0;
        fact.scatter = surface.scatter;
        fact.off_sigma = (fact.value - fact.predicted) / fact.sigma.hypot(fact.scatter);
        (fact.from_others, fact.decides) = without(search, likely, emulator, at);
        facts.push(fact);
    }
    for observation in dataset.observations.iter().filter(|observation| observation.is_foretold()) {
        let mut fact = fact(observation, false);
        match likely.foretell(search, observation, points) {
            Some([mean, sd, scatter]) => {
                (fact.predicted, fact.scatter) = (mean, sd.hypot(scatter));
                fact.off_sigma = (fact.value - mean) / fact.sigma.hypot(fact.scatter);
                facts.push(fact);
            }
            None => remarks.push(format!("{} ({}) cannot be foretold: most runs do not give it", fact.measure, fact.setting)),
        }
    }
    facts
}

/// What the other numbers foretell of number `at`, and the factor by which the ranges widen without it.
fn without(search: &Search, likely: &Likely, emulator: &Emulator, at: usize) -> (Option<[f64; 3]>, f64) {
    let Found { best, .. } = likely.found;
    let (Some(surface), Some(wider)) = (&emulator.surfaces[at], Likely::new(search, likely.found, Some(at))) else {
        return (None, 1.0);
    };
    let count = best.0.len();
    let widths = (0..count).map(|k| (wider.covariance[(k, k)] / likely.covariance[(k, k)]).sqrt().ln()).sum::<f64>();
    let others = Likelihood { emulator, observed: &search.observed, without: Some(at) };
    let (x, _) = others.minimise(&best.0, None);
    let (predicted, slopes) = emulator.at(surface, &x);
    let slopes = DVector::from_vec(slopes);
    let by_constants = (slopes.transpose() * &wider.covariance * &slopes)[(0, 0)];
    let sd = (by_constants + surface.scatter.powi(2)).sqrt();
    let (value, sigma) = search.observed[at];
    (Some([predicted, sd, (value - predicted) / sigma.hypot(sd)]), (widths / count.max(1) as f64).exp())
}

/// Frequency of an observation's drive (Hz).
fn frequency(observation: &Observation) -> Option<f64> {
    observation.drive.frequency_hz.or(observation.drive.period_s.map(|period| 1.0 / period))
}

/// Whole frequencies between those measured that were not, with how much the likely constants differ there.
fn proposals(search: &Search, likely: &Likely, points: &[Point]) -> Vec<Proposal> {
    let mut settings: Vec<(&Observation, f64)> = Vec::new();
    let mut seen: Vec<&Observation> = Vec::new();
    for observation in &search.fitted {
        let is_like = |other: &&Observation| {
            other.measure == observation.measure
                && other.drive.gait == observation.drive.gait
                && other.drive.waveform == observation.drive.waveform
        };
        if seen.iter().any(is_like) {
            continue;
        }
        seen.push(observation);
        let measured: Vec<f64> = search.fitted.iter().copied().filter(is_like).filter_map(frequency).collect();
        let (low, high) = measured.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), f| (low.min(*f), high.max(*f)));
        if !(low > 0.0 && high <= 200.0) {
            continue;
        }
        let whole = (low.ceil() as u32).saturating_sub(2).max(1)..=high.floor() as u32 + 2;
        let fresh = whole.map(f64::from).filter(|f| measured.iter().all(|other| (other - f).abs() > 0.25));
        settings.extend(fresh.map(|f| (*observation, f)));
    }
    settings.truncate(MOST_PROPOSALS);
    let proposal = |(like, frequency_hz): (&Observation, f64)| {
        let mut observation = like.clone();
        (observation.drive.frequency_hz, observation.drive.period_s) = (Some(frequency_hz), None);
        let [_, uncertain_by, scatter] = likely.foretell(search, &observation, points)?;
        Some(Proposal { measure: like.measure.clone(), frequency_hz, uncertain_by, scatter: scatter.hypot(like.sigma) })
    };
    let mut proposals: Vec<Proposal> = settings.into_iter().filter_map(proposal).collect();
    let worth = |p: &Proposal| p.uncertain_by / p.scatter.max(f64::MIN_POSITIVE);
    proposals.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
    proposals
}

/// A value of a key in words.
pub(super) fn told(key: &str, value: f64) -> String {
    let unit = split_unit(key).map_or_else(String::new, |(_, unit)| format!(" {unit}"));
    let digits = (2 - value.abs().max(1e-12).log10().floor() as i32).clamp(0, 6) as usize;
    format!("{}{unit}", crate::number::fixed(value, digits))
}

fn summary(result: &Identification, search: &Search, confirmed: &Confirmed, fewer: bool) -> String {
    let missed: Vec<String> = (0..search.fitted.len())
        .filter(|at| !confirmed.meets(search, *at))
        .map(|at| {
            let observation = search.fitted[at];
            let mean = confirmed.spreads[at].map_or_else(|| "nothing".into(), |spread| crate::number::fixed(spread.mean, 2));
            let under =
                frequency(observation).map_or_else(|| setting(observation), |f| format!("{} Hz", crate::number::fixed(f, 1)));
            format!("{} at {under} is {mean}, not {}", observation.measure, crate::number::fixed(observation.value, 2))
        })
        .collect();
    let constants = result.confirmed.iter().map(|(key, value)| format!("{key} = {}", told(key, *value))).collect::<Vec<_>>();
    let constants = constants.join(", ");
    let met = if missed.is_empty() {
        let within = crate::number::fixed(confirm::met(search.fitted.len()), 1);
        format!("A robot with {constants} meets every number: the means of eight runs lie within {within} standard deviations.")
    } else {
        format!(
            "No constants within the ranges were found that meet every number; closest comes {constants}, where {}.",
            missed.join("; ")
        )
    };
    let ranges = result.constants.iter().filter_map(|c| {
        let [low, high] = c.range95?.map(|end| told(&c.key, end));
        Some(format!("{} = {} ({low} to {high})", c.key, told(&c.key, c.value)))
    });
    let listed = result.listed.iter().map(|c| {
        let possible = c.possible.iter().map(|value| told(&c.key, *value)).collect::<Vec<_>>().join(" or ");
        format!("{} = {possible}", c.key)
    });
    let values = ranges.chain(listed).collect::<Vec<_>>().join(", ");
    if result.constants.iter().any(|c| c.range95.is_none()) {
        return format!(
            "{met} The best are off by {} standard deviations rms, more than noise and scatter explain: there are no 95 % ranges. The standard deviations are too small, the ranges \
             of the search leave the robot out, or the model lacks something.",
            crate::number::fixed(result.misfit_sigma, 1)
        );
    }
    let set = match (fewer, result.is_set) {
        (true, _) => " There are fewer numbers than constants: the answer is a set, of which the corners are listed.",
        (false, true) => {
            " Some constants stay open over their whole range: the answer is a set, of which the corners are listed."
        }
        _ => "",
    };
    format!("{met} 95 % ranges: {values}.{set}")
}
