//! Single measured numbers: which one cause, or which two constants, could bring the nominal model to them.
//!
//! A handful of numbers cannot be split into fit and held-out, and cannot name a cause; they can rule causes out, and say what ties them.

use super::dataset::{Dataset, Observation};
use super::diagnosis::{Adopted, Diagnosis, Estimate, Ranked, RunError, Stage, Verdict};
use super::fit::{Bench, Care, Fit};
use super::plant::{Candidate, Model, Plant, Signal, Term};
use super::{names, robot};
use crate::experiment::{self, Config, ConfigError, Control, EffectConfig, Source};
use crate::model::Mount;
use crate::number::fixed;
use crate::recording::definitions;
use crate::words;

/// A model explains the numbers if each lies within two standard deviations, in the mean.
const EXPLAINED: f64 = 4.0;
/// Length (s), step (s) and interval of records (s) of a run whose file says nothing of them.
const DURATION: f64 = 2.0;
const STEP: f64 = 2e-4;
const RECORD: f64 = 1e-3;

/// Most time steps of a number's run.
const MOST_STEPS: f64 = 2e7;

/// Numbers as a plant: every number is a run with one value.
struct Numbers<'a> {
    dataset: &'a Dataset,
    signals: Vec<Signal>,
    candidates: Vec<Candidate>,
}

/// The experiment behind a number. A resonance that is driven by a sine without frequency is taken from how a step rings.
fn config(nominal: &Config, observation: &Observation) -> Result<Config, String> {
    let merged = |own: toml::Value, over: toml::Value| match (own, over) {
        (toml::Value::Table(mut own), toml::Value::Table(over)) => {
            own.extend(over);
            toml::Value::Table(own)
        }
        (_, over) => over,
    };
    let text = |error: &dyn std::fmt::Display| format!("{}: {error}", observation.measure);
    let value = |v: Result<toml::Value, toml::ser::Error>| v.map_err(|error| text(&error));
    let robot = merged(value(toml::Value::try_from(&nominal.robot))?, value(toml::Value::try_from(&observation.robot))?);
    let material = merged(value(toml::Value::try_from(&nominal.material))?, value(toml::Value::try_from(&observation.material))?);
    let mut config = Config {
        robot: robot.try_into().map_err(|error: toml::de::Error| text(&error))?,
        material: material.try_into().map_err(|error: toml::de::Error| text(&error))?,
        drive: observation.drive.clone(),
        simulation: observation.simulation.clone(),
        effect: Vec::new(),
    };
    let drive = &mut config.drive;
    if observation.measure == "resonance_hz" && drive.waveform.as_deref() == Some("sine") && drive.frequency_hz.is_none() {
        let actuators = config.robot.actuators.unwrap_or(5);
        let volts = drive.amplitudes_v.take().unwrap_or_else(|| vec![drive.amplitude_v.unwrap_or(0.0); actuators]);
        drive.amplitude_v = None;
        drive.waveform = Some("step".into());
        drive.voltages_v = Some(volts);
    }
    let s = &mut config.simulation;
    s.engine.get_or_insert("planar".into());
    if s.time_step_s.is_none() {
        s.time_step_s = Some(experiment::StepConfig::Seconds(STEP));
    }
    if s.steps.is_none() && s.duration_s.is_none() {
        s.duration_s = Some(DURATION);
    }
    if s.record_every_s.is_none() && s.record_every_steps.is_none() {
        s.record_every_s = Some(RECORD);
    }
    Ok(config)
}

/// What is wrong with an observation.
pub(super) enum Fault {
    /// A value, by its key within the observation.
    At {
        /// The key.
        key: String,
        /// What is wrong.
        message: String,
    },
    /// A file that it names.
    Other(ConfigError),
}

impl Fault {
    fn at(key: &str, message: impl Into<String>) -> Self {
        Self::At { key: key.into(), message: message.into() }
    }
}

/// Whether an observation makes sense: its measure can be had from its mount and drive, and its experiment can be run.
pub(super) fn check(nominal: &Config, observation: &Observation) -> Result<(), Fault> {
    let measure = observation.measure.as_str();
    if !definitions::names().contains(&measure) {
        return Err(Fault::at("measure", words::not_one_of(measure, &definitions::names())));
    }
    if !observation.value.is_finite() {
        return Err(Fault::at("value", format!("is {}, but must be a number", observation.value)));
    }
    if !(observation.sigma.is_finite() && observation.sigma > 0.0) {
        return Err(Fault::at("sigma", format!("is {}, but must be a positive number", observation.sigma)));
    }
    let config = config(nominal, observation).map_err(|message| Fault::at("measure", message))?;
    let text = toml::to_string(&config).map_err(|error| Fault::at("measure", error.to_string()))?;
    let experiment = experiment::experiment(&Source::from_text(measure, text)).map_err(|error| match error {
        ConfigError::Value { key, message, .. } => Fault::At { key, message },
        other => Fault::Other(other),
    })?;
    if experiment.steps as f64 > MOST_STEPS {
        let message =
            format!("the run has {} steps, more than {MOST_STEPS:.0e}, and a diagnosis needs hundreds of runs", experiment.steps);
        return Err(Fault::at("simulation", message));
    }
    let (mount, repeats) = (experiment.robot.mount, experiment.drive.period().is_some());
    let refused = match measure {
        "energy_error" => Some("is known to a run only, no camera measures it"),
        "tip_deflection_mm"
        | "tip_amplitude_mm"
        | "tip_phase_deg"
        | "resonance_hz"
        | "damping_ratio"
        | "half_power_bandwidth_hz"
            if mount != Mount::Clamped =>
        {
            Some("is a measure of clamped robots; set mount = \"clamped\"")
        }
        "jump_height_mm" | "speed_mm_s" | "displacement_sum_mm" | "stride_mm" | "period_ratio" | "mid_end_phase_deg"
            if mount == Mount::Clamped =>
        {
            Some("is no measure of a clamped robot")
        }
        "body_touching" | "end_touching" | "aerial" if mount != Mount::Ground => Some("is a measure of robots on the ground"),
        "tip_phase_deg" | "stride_mm" | "period_ratio" | "mid_end_phase_deg" if !repeats => Some("needs a drive with a period"),
        "resonance_hz" | "damping_ratio" | "half_power_bandwidth_hz" if repeats => {
            Some("is taken from how the tip rings after a step: give a step, or for resonance_hz a sine without frequency_hz")
        }
        _ => None,
    };
    refused.map_or(Ok(()), |why| Err(Fault::at("measure", format!("{measure} {why}"))))
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

    fn predict(&self, model: &Model, run: usize, _nuisances: &[f64]) -> Result<Vec<f64>, String> {
        let observation = &self.dataset.observations[run];
        let mut config = config(&self.dataset.nominal, observation)?;
        for term in &model.terms {
            let candidate = &self.candidates[term.candidate];
            let free = candidate.parameters.iter().zip(&term.x).map(|(p, x)| (p.name.to_owned(), p.value(*x)));
            let given = candidate.fixed.iter().map(|(name, value)| ((*name).to_owned(), *value));
            let parameters = free.chain(given).filter(|(_, value)| value.is_finite()).collect();
            config.effect.push(EffectConfig { id: candidate.id.into(), parameters });
        }
        let text = toml::to_string(&config).map_err(|error| error.to_string())?;
        let experiment =
            experiment::experiment(&Source::from_text(&observation.measure, text)).map_err(|error| error.to_string())?;
        let mut engine = experiment.engine().map_err(|error| error.to_string())?;
        let done = experiment::run(&experiment, engine.as_mut(), |_| Control::Continue).map_err(|error| error.to_string())?;
        let value = done.measures.get(&observation.measure);
        Ok(vec![value.ok_or_else(|| format!("{} cannot be had from its drive", observation.measure))?])
    }
}

/// One measured number beside the models, in the measure's unit.
struct Number {
    measure: String,
    /// What it was measured under.
    setting: String,
    value: f64,
    sigma: f64,
    nominal: f64,
    best: f64,
}

/// A way to reach the numbers: one cause or two constants, and the misfit left (standard deviations, rms).
struct Way {
    effects: Vec<Adopted>,
    misfit: f64,
}

/// What single numbers say.
pub struct Found {
    /// In the form that all diagnoses have.
    pub diagnosis: Diagnosis,
    numbers: Vec<Number>,
    ways: Vec<Way>,
}

/// The drive of a number in words.
fn setting(observation: &Observation) -> String {
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

/// What single numbers say: which single causes and which pairs of constants reach them.
///
/// # Errors
/// If the nominal model cannot be simulated, in words.
pub fn diagnose(dataset: &Dataset, progress: &(dyn Fn(&str) + Sync)) -> Result<Found, String> {
    let signals = dataset.observations.iter().enumerate().map(|(index, o)| Signal {
        id: format!("{}-{}", index + 1, o.measure),
        values: vec![o.value],
        sigmas: vec![o.sigma],
        times: vec![0.0],
        channels: vec![0],
        inputs: vec![0.0],
    });
    let plant = Numbers { dataset, signals: signals.collect(), candidates: robot::candidates(&dataset.robot, 1) };
    let runs: Vec<usize> = (0..plant.signals.len()).collect();
    let bench = Bench::new(&plant);
    let resolution = dataset.robot.motors_per_actuator as f64;
    let nominal = Model { terms: Vec::new(), resolution, fine: false };
    let nominal = bench.fit(&nominal, &runs, Care::Full)?;
    let count = runs.len() as f64;

    // One cause at a time, then two constants: with one number each a fit proves nothing, so all that reach them are listed.
    let mut fits: Vec<Fit> = Vec::new();
    for (candidate, c) in plant.candidates.iter().enumerate().filter(|(_, c)| c.parameters.len() == 1) {
        progress(c.id);
        let tried = c.starts.iter().filter_map(|x| {
            let terms = vec![Term { candidate, x: x.clone() }];
            bench.fit(&Model { terms, resolution, fine: false }, &runs, Care::Full).ok()
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
                let start = Model { terms: vec![term(*a), term(*b)], resolution, fine: false };
                pairs.extend(bench.fit(&start, &runs, Care::Full).ok().filter(|fit| fit.chi2 <= EXPLAINED * count));
            }
        }
    }
    let mut explained = if single.is_empty() { pairs } else { single };
    explained.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let fine = nominal.chi2 <= EXPLAINED * count;
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
                        at_bound: term.x[0] <= free.bounds[0] || term.x[0] >= free.bounds[1],
                    }],
                    tied_with: Vec::new(),
                    gain_heldout: 0.0,
                    fixed: c.fixed.iter().map(|(name, value)| ((*name).into(), *value)).collect(),
                }
            })
            .collect::<Vec<_>>()
    };
    let effects: Vec<Adopted> = if fine {
        Vec::new()
    } else {
        let others: Vec<String> = explained.iter().skip(1).map(&name).collect();
        let mut first = explained.first().map(adopted).unwrap_or_default();
        first.iter_mut().for_each(|effect| effect.tied_with.clone_from(&others));
        first
    };
    let verdict = match (fine, explained.len()) {
        (true, _) => Verdict::None,
        (false, 0) => Verdict::Unexplained,
        // A number or two never name one cause.
        (false, _) => Verdict::Tied,
    };
    let stage = |fit: &Fit| -> Result<Stage, String> {
        let residuals = bench.residuals_of(&fit.model, &runs)?;
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
        Verdict::None => "The nominal model reaches all numbers within two standard deviations.".to_owned(),
        Verdict::Unexplained => "No single cause and no two constants of the nominal model reach all numbers.".to_owned(),
        _ => format!(
            "The nominal model misses the numbers; these would reach them, and the numbers cannot tell which it is: {list}."
        ),
    };
    let mut ranked: Vec<&Fit> = fits.iter().collect();
    ranked.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let best = explained.first().filter(|_| !fine).unwrap_or(&nominal);
    let predicted = |fit: &Fit| -> Result<Vec<f64>, String> {
        let residuals = bench.residuals_of(&fit.model, &runs)?;
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
    let reaching: &[Fit] = if fine { &[] } else { &explained };
    let ways = reaching.iter().map(|fit| Way { effects: adopted(fit), misfit: (fit.chi2 / count).sqrt() }).collect();
    let numbers = numbers.collect();
    let diagnosis = Diagnosis {
        schema: 1,
        dataset: dataset.name.clone(),
        verdict,
        summary,
        effects,
        unexplained_fraction: if nominal.chi2 > count { ((best.chi2 - count).max(0.0) / (nominal.chi2 - count)).min(1.0) } else { 0.0 },
        unexplained: Vec::new(),
        noise_mm: 0.0,
        baseline: stage(&nominal)?,
        calibrated: stage(best)?,
        extended: stage(best)?,
        candidates: ranked
            .into_iter()
            .map(|fit| Ranked { id: name(fit), form: form(fit), rmse_heldout_mm: (fit.chi2 / count).sqrt(), delta_bic: fit.chi2 + count.ln() - nominal.chi2 })
            .collect(),
        correlations: Vec::new(),
        condition: 1.0,
        next_experiment: (verdict == Verdict::Tied).then(|| {
            "weigh the sheet (mass), film the root and the whole shape at rest and under a slow voltage (clamp, curvature, gain), and let it ring from \
             two amplitudes (damping, softening)"
                .to_owned()
        }),
        data_quality: Vec::new(),
        remarks: vec!["candidates are ranked by their misfit in standard deviations; there is no held-out number".into()],
    };
    Ok(Found { diagnosis, numbers, ways })
}

/// The page, in the style of the [`report`]: the verdict, every number, what would reach them.
#[cfg(feature = "view")]
pub fn page(found: &Found, dataset: &Dataset, command: &str) -> String {
    use super::report;
    use crate::view::page::{Cell, Table, document};
    use crate::view::{digits_for, escape, label_of, signed};

    let Found { diagnosis: d, numbers, ways } = found;
    let mut out = report::heading(d);
    out.push_str(
        "<p class=\"small\">Single numbers cannot be split into some to fit and some to judge by: they rule causes out, and say what ties them, but name \
         none. σ is one standard deviation.</p>\n<h2>The numbers</h2>\n",
    );
    let columns = ["number", "under", "#measured", "#± one σ", "#nominal model", "#off by (σ)"];
    let mut table = Table::new(&[&columns[..], &["#with the best below", "#off by (σ)"]].concat()).stacking();
    for number in numbers {
        let digits = digits_for(number.sigma);
        let off = |predicted: f64| (number.value - predicted) / number.sigma;
        let cell = |predicted: f64| Cell::from(signed(-off(predicted), 1)).bad_if(off(predicted).abs() > EXPLAINED.sqrt());
        table.row([
            label_of(&number.measure).into(),
            number.setting.as_str().into(),
            fixed(number.value, digits).into(),
            fixed(number.sigma, digits).into(),
            fixed(number.nominal, digits).into(),
            cell(number.nominal),
            fixed(number.best, digits).into(),
            cell(number.best),
        ]);
    }
    out.push_str(&table.html());
    out.push_str("<h2>What would reach them</h2>\n");
    if ways.is_empty() {
        out.push_str(match d.verdict {
            Verdict::None => "<p>Nothing has to be added: the nominal model does.</p>\n",
            _ => "<p>No single cause, and no two constants.</p>\n",
        });
    } else {
        let constants = names::constants(&dataset.robot);
        let mut table =
            Table::new(&["cause, form", "constant", "#value", "#95 % range", "unit", "remark", "#misfit (σ, rms)"]).stacking();
        for way in ways {
            for effect in &way.effects {
                for estimate in &effect.parameters {
                    let shown = names::shown(&effect.id, estimate, &constants);
                    table.row([
                        names::with_form(&effect.id, &names::form_of(effect)).into(),
                        shown.name.into(),
                        shown.value.into(),
                        shown.range.into(),
                        shown.unit.into(),
                        Cell::from(shown.note).bad_if(estimate.at_bound),
                        fixed(way.misfit, 2).into(),
                    ]);
                }
            }
        }
        out.push_str(&table.html());
        let two = if ways.iter().any(|way| way.effects.len() > 1) { " Two rows of one misfit belong together." } else { "" };
        out += &format!("<p class=\"small\">Each of them does it alone; the numbers cannot tell which it is.{two}</p>\n");
    }
    out.push_str("<h2>All causes tried, one at a time</h2>\n");
    let mut table = Table::new(&["cause, form", "#misfit (σ, rms)"]);
    for c in &d.candidates {
        table.row([names::with_form(&c.id, &c.form).into(), fixed(c.rmse_heldout_mm, 2).into()]);
    }
    out.push_str(&table.html());
    if let Some(next) = &d.next_experiment {
        out += &format!("<h2>What to measure next</h2>\n<p>To tell them apart: {}.</p>\n", report::prose(next));
    }
    out += &format!("<h2>How to reproduce</h2>\n<p><code>{}</code></p>\n", escape(command));
    document(&format!("Diagnosis of {}", d.dataset), &out)
}
