//! Diagnosis of observations, single measured numbers: the single causes, or pairs of constants, that explain them.
//!
//! A few numbers allow no held-out set and cannot identify a cause; they rule causes out and show which are tied.

mod config;
#[cfg(feature = "view")]
mod page;

pub(super) use config::{ObservationError, check, config};
#[cfg(feature = "view")]
pub use page::page;

use super::DiagnoseError;
use super::candidates::candidates;
use super::dataset::{Dataset, Observation};
use super::diagnosis::{Adopted, BenchFound, Diagnosis, Estimate, Part, Ranked, RunError, Stage, Verdict};
use super::fit::{Convergence, Estimator, Fit};
use super::names;
use super::plant::{Candidate, Model, Nuisance, Plant, Signal, Term};
use super::visited::Visited;
use crate::effects::{self, Bench, EffectError};
use crate::experiment::{self, Control, EffectConfig, Source};
use crate::number::fixed;

/// Largest χ² per number of a model that explains them: 2 σ (rms).
const EXPLAINED: f64 = 4.0;

/// Observations as a plant: each is a run with one value.
struct Numbers<'a> {
    dataset: &'a Dataset,
    signals: Vec<Signal>,
    candidates: Vec<Candidate>,
}

impl Plant for Numbers<'_> {
    fn signals(&self) -> &[Signal] {
        &self.signals
    }

    fn channels(&self) -> Vec<String> {
        vec!["value".into()]
    }

    fn unit(&self) -> &'static str {
        ""
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    fn predict(&self, model: &Model, run: usize, _nuisance: &Nuisance) -> Result<Vec<f64>, DiagnoseError> {
        let observation = &self.dataset.observations[run];
        let mut config = config(&self.dataset.nominal, observation)?;
        for term in &model.terms {
            let candidate = &self.candidates[term.candidate];
            let effect = effects::find(candidate.id).ok_or_else(|| EffectError::Unknown(candidate.id.into()))?;
            let free = candidate.parameters.iter().zip(&term.x).map(|(p, x)| (p.name, p.value(*x)));
            let parameters = free.chain(candidate.fixed.iter().copied()).filter(|(_, value)| value.is_finite());
            config.effect.push(EffectConfig::new(effect, parameters));
        }
        let measure = || observation.measure.clone();
        let text = toml::to_string(&config)
            .map_err(|error| DiagnoseError::Observation { measure: measure(), reason: error.to_string() })?;
        let experiment = experiment::experiment(&Source::from_text(&observation.measure, text))?;
        let mut engine = experiment.engine()?;
        let done = experiment::run(&experiment, engine.as_mut(), |_| Control::Continue)?;
        let value = done.measures.get(&observation.measure);
        Ok(vec![value.ok_or_else(|| DiagnoseError::Measure { measure: measure() })?])
    }
}

/// A measured number and its predictions, in the measure's unit.
struct Number {
    measure: String,
    /// The drive, in words.
    setting: String,
    value: f64,
    sigma: f64,
    nominal: f64,
    best: f64,
}

/// One cause or two constants that explain the numbers.
struct Explanation {
    effects: Vec<Adopted>,
    /// Misfit that is left (σ, rms).
    misfit: f64,
}

/// The diagnosis of observations.
pub struct Found {
    /// The common form of all diagnoses.
    pub diagnosis: Diagnosis,
    numbers: Vec<Number>,
    explanations: Vec<Explanation>,
}

/// The drive of an observation in words.
pub(super) fn setting(observation: &Observation) -> String {
    let drive = &observation.drive;
    let volts = drive.voltages_v.clone().or(drive.amplitudes_v.clone()).or(drive.amplitude_v.map(|volts| vec![volts]));
    let volts = volts.unwrap_or_default().iter().map(|volts| fixed(*volts, 0)).collect::<Vec<_>>().join(", ");
    let waveform = match drive.waveform.as_deref().or(drive.gait.as_deref()) {
        Some("dc") => "constant voltage",
        Some(name) => name,
        None => "gait",
    };
    if volts.is_empty() { waveform.into() } else { format!("{waveform}, {volts}\u{a0}V") }
}

/// Diagnoses a data set's observations: the single causes, or else the pairs of constants, that explain them.
///
/// # Errors
/// [`DiagnoseError`] if the nominal model cannot be simulated.
pub fn diagnose(dataset: &Dataset, progress: &(dyn Fn(&str) + Sync)) -> Result<Found, DiagnoseError> {
    let signals = dataset.observations.iter().enumerate().map(|(index, o)| Signal {
        id: format!("{}-{}", index + 1, o.measure),
        values: vec![o.value],
        sigmas: vec![o.sigma],
        times: vec![0.0],
        channels: vec![0],
        inputs: vec![0.0],
        ..Signal::default()
    });
    let plant = Numbers {
        dataset,
        signals: signals.collect(),
        candidates: candidates(&Bench::new(&dataset.robot, 1, 1), &Visited::NOTHING),
    };
    let runs: Vec<usize> = (0..plant.signals.len()).collect();
    let estimator = Estimator::new(&plant);
    let resolution = dataset.robot.motors_per_actuator as f64;
    let nominal = Model::new(Vec::new(), resolution, false);
    let nominal = estimator.fit(&nominal, &runs, Convergence::Full)?;
    let count = runs.len() as f64;

    // One cause at a time, then two constants; all that explain the numbers are listed.
    let mut fits: Vec<Fit> = Vec::new();
    for (candidate, c) in
        plant.candidates.iter().enumerate().filter(|(_, c)| c.parameters.len() == 1 && !c.is_free_form && !c.is_variant)
    {
        progress(c.id);
        let tried = c.starts.iter().filter_map(|x| {
            let terms = vec![Term { candidate, x: x.clone() }];
            estimator.fit(&Model::new(terms, resolution, false), &runs, Convergence::Full).ok()
        });
        fits.extend(tried.min_by(|a, b| a.chi2.total_cmp(&b.chi2)));
    }
    let single: Vec<Fit> = fits.iter().filter(|fit| fit.chi2 <= EXPLAINED * count).cloned().collect();
    let mut pairs = Vec::new();
    if single.is_empty() {
        let constants: Vec<usize> = (0..plant.candidates.len()).filter(|c| plant.candidates[*c].is_constant).collect();
        for (index, a) in constants.iter().enumerate() {
            for b in &constants[index + 1..] {
                progress(&format!("{} with {}", plant.candidates[*a].id, plant.candidates[*b].id));
                let term = |candidate: usize| Term { candidate, x: vec![1.0] };
                let start = Model::new(vec![term(*a), term(*b)], resolution, false);
                pairs.extend(estimator.fit(&start, &runs, Convergence::Full).ok().filter(|fit| fit.chi2 <= EXPLAINED * count));
            }
        }
    }
    let mut explained = if single.is_empty() { pairs } else { single };
    explained.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let is_nominal_enough = nominal.chi2 <= EXPLAINED * count;
    let name =
        |fit: &Fit| fit.model.terms.iter().map(|term| plant.candidates[term.candidate].id).collect::<Vec<_>>().join(" with ");
    let form = |fit: &Fit| match &fit.model.terms[..] {
        [term] => {
            let c = &plant.candidates[term.candidate];
            names::form(c.id, &c.fixed, c.parameters.iter().map(|p| p.name))
        }
        _ => String::new(),
    };
    let words = |fit: &Fit| {
        let causes = fit.model.terms.iter().map(|term| names::cause(plant.candidates[term.candidate].id));
        names::with_form(&causes.collect::<Vec<_>>().join(" with "), &form(fit))
    };
    let adopted = |fit: &Fit| {
        let terms = fit.model.terms.iter().enumerate();
        terms
            .map(|(index, term)| {
                let c = &plant.candidates[term.candidate];
                let spread = 1.96 * super::search::covariance(&fit.information)[(index, index)].sqrt();
                let free = &c.parameters[0];
                let ends = [term.x[0] - spread, term.x[0] + spread].map(|x| free.value(x.clamp(free.bounds[0], free.bounds[1])));
                Adopted {
                    id: c.id.into(),
                    kind: c.kind.into(),
                    cause: c.cause.into(),
                    parameters: vec![Estimate {
                        name: free.name.into(),
                        value: free.value(term.x[0]),
                        unit: free.unit.into(),
                        ci95: [Some(ends[0].min(ends[1])), Some(ends[0].max(ends[1]))]
                            .map(|end| end.filter(|x: &f64| x.is_finite())),
                        at_bound: free.is_at_bound(term.x[0]),
                    }],
                    tied_with: Vec::new(),
                    share: 1.0,
                    place: c.places.first().copied().unwrap_or(c.kind).to_owned(),
                    role: Part::Cause,
                    stability: None,
                    curve: None,
                    nearest: Vec::new(),
                    gain_heldout: 0.0,
                    fixed: c.fixed.iter().map(|(name, value)| ((*name).into(), *value)).collect(),
                }
            })
            .collect::<Vec<_>>()
    };
    let effects: Vec<Adopted> = if is_nominal_enough {
        Vec::new()
    } else {
        let others: Vec<String> = explained.iter().skip(1).map(&name).collect();
        let mut first = explained.first().map(adopted).unwrap_or_default();
        first.iter_mut().for_each(|effect| effect.tied_with.clone_from(&others));
        first
    };
    let verdict = match (is_nominal_enough, explained.len()) {
        (true, _) => Verdict::None,
        (false, 0) => Verdict::Unexplained,
        // A few numbers never identify a cause.
        (false, _) => Verdict::Tied,
    };
    let stage = |fit: &Fit| -> Result<Stage, DiagnoseError> {
        let residuals = estimator.residuals_of(&fit.model, &runs)?;
        let runs = plant.signals.iter().zip(&residuals).map(|(signal, r)| RunError {
            id: signal.id.clone(),
            role: "fit",
            rmse_mm: r[0].abs() * signal.sigmas[0],
            rmse_sigma: r[0].abs(),
        });
        Ok(Stage {
            runs: runs.collect(),
            rmse_mm: 0.0,
            rmse_heldout_mm: 0.0,
            rmse_heldout_ci95_mm: [0.0; 2],
            residual_tests: Vec::new(),
            parameters: Vec::new(),
        })
    };
    let list = explained.iter().map(&words).collect::<Vec<_>>().join("; ");
    let summary = match verdict {
        Verdict::None => "The nominal model explains all numbers within two standard deviations.".to_owned(),
        Verdict::Unexplained => "No single cause and no two constants of the nominal model explain all numbers.".to_owned(),
        _ => format!(
            "The nominal model does not explain the numbers; any of these causes would, and the numbers cannot tell which: {list}."
        ),
    };
    let mut ranked: Vec<&Fit> = fits.iter().collect();
    ranked.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let best = explained.first().filter(|_| !is_nominal_enough).unwrap_or(&nominal);
    let predicted = |fit: &Fit| -> Result<Vec<f64>, DiagnoseError> {
        let residuals = estimator.residuals_of(&fit.model, &runs)?;
        Ok(dataset.observations.iter().zip(&residuals).map(|(o, r)| o.value - r[0] * o.sigma).collect())
    };
    let (of_nominal, of_best) = (predicted(&nominal)?, predicted(best)?);
    let numbers = dataset.observations.iter().zip(of_nominal.into_iter().zip(of_best)).map(|(o, (nominal, best))| Number {
        measure: o.measure.clone(),
        setting: setting(o),
        value: o.value,
        sigma: o.sigma,
        nominal,
        best,
    });
    let listed: &[Fit] = if is_nominal_enough { &[] } else { &explained };
    let explanations =
        listed.iter().map(|fit| Explanation { effects: adopted(fit), misfit: (fit.chi2 / count).sqrt() }).collect();
    let numbers = numbers.collect();
    let diagnosis = Diagnosis {
        schema: 2,
        dataset: dataset.name.clone(),
        verdict,
        complete: verdict != Verdict::Unexplained,
        summary,
        effects,
        unexplained_fraction: if nominal.chi2 > count { ((best.chi2 - count).max(0.0) / (nominal.chi2 - count)).min(1.0) } else { 0.0 },
        unexplained: Vec::new(),
        noise_mm: 0.0,
        noise_correlated: 0.0,
        judged_by: None,
        bench: BenchFound::default(),
        baseline: stage(&nominal)?,
        calibrated: stage(best)?,
        extended: stage(best)?,
        prediction: None,
        candidates: ranked
            .into_iter()
            .map(|fit| Ranked { id: name(fit), form: form(fit), rmse_heldout_mm: (fit.chi2 / count).sqrt(), delta_bic: fit.chi2 + count.ln() - nominal.chi2 })
            .collect(),
        correlations: Vec::new(),
        combinations: Vec::new(),
        condition: 1.0,
        next_experiment: (verdict == Verdict::Tied).then(|| {
            "weigh the sheet (mass), film the root and the whole shape at rest and under a slow voltage (clamp, curvature, gain), and let it ring from \
             two amplitudes (damping, softening)"
                .to_owned()
        }),
        data_quality: Vec::new(),
        remarks: vec!["candidates are ranked by their misfit in standard deviations; there is no held-out number".into()],
    };
    Ok(Found { diagnosis, numbers, explanations })
}
