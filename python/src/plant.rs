//! `sfers_rs.diagnose_plant`: the diagnosis of a plant whose model is in Python. `sfers_rs/plant.py` checks it and puts it into the numbers that are taken here.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use sfers::diagnose::DiagnoseError;
use sfers::diagnose::bench::{KINDS, Spread};
use sfers::diagnose::dataset::Role;
use sfers::diagnose::plant::{Candidate, Free, FreeCurve, Model, Nuisance, Plant, Signal, Term};
use sfers::diagnose::{extended, pipeline, report};

use crate::diagnose::{Found, json};
use crate::error;
use crate::service::{Call, Line, Predicted, Request, jobs, serve};

/// Ends the ids of a plant's candidates, invisible, so that none is taken for a cause of this project's robots, to which reports give names of their
/// own. It is taken out of every text.
const MARK: char = '\u{2060}';
/// Least distance of two models (σ, all values of a run together) that a measurement can tell.
const LEAST_DISTANCE: f64 = 3.0;

/// A text for as long as the process lives, as the library's names are: each is kept once.
fn kept(text: &str) -> &'static str {
    static KEPT: Mutex<Option<HashMap<String, &'static str>>> = Mutex::new(None);
    let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    kept.get_or_insert_default().entry(text.to_owned()).or_insert_with(|| Box::leak(text.to_owned().into_boxed_str()))
}

fn without_mark(text: &str) -> String {
    text.replace(MARK, "")
}

/// A run: values channel after channel, without missing ones.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct GivenRun {
    id: String,
    values: Vec<f64>,
    sigmas: Vec<f64>,
    times: Vec<f64>,
    channels: Vec<usize>,
    inputs: Vec<f64>,
    /// Time (s) of the first row.
    start: f64,
    /// `auto`, `fit` or `held-out`.
    role: String,
    nuisances: usize,
    moves_unaided: bool,
}

#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct GivenParameter {
    name: String,
    unit: String,
    /// Coordinates, of 1/value if `inverse`.
    off: Option<f64>,
    bounds: [f64; 2],
    scale: f64,
    inverse: bool,
}

#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct GivenCandidate {
    id: String,
    kind: String,
    cause: String,
    place: String,
    variant: bool,
    constant: bool,
    parameters: Vec<GivenParameter>,
    fixed: Vec<(String, f64)>,
    starts: Vec<Vec<f64>>,
    curve: Option<GivenCurve>,
}

/// A free form: a curve through the values of its parameters.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct GivenCurve {
    x_name: String,
    x_unit: String,
    y_name: String,
    y_unit: String,
    x: Vec<f64>,
}

/// A run that could be measured next.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct GivenProposal {
    id: String,
    sigmas: Vec<f64>,
}

/// A plant as `sfers_rs/plant.py` describes it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Given {
    name: String,
    unit: String,
    channels: Vec<String>,
    /// Standard deviations of the bench's faults; none to estimate them.
    bench: [Option<f64>; KINDS],
    runs: Vec<GivenRun>,
    /// Their indices go on from those of the runs.
    proposals: Vec<GivenProposal>,
    candidates: Vec<GivenCandidate>,
}

fn candidate(given: GivenCandidate) -> Candidate {
    let free = |p: GivenParameter| Free {
        name: kept(&p.name),
        unit: kept(&p.unit),
        off: p.off,
        bounds: p.bounds,
        scale: p.scale,
        inverse: p.inverse,
    };
    Candidate {
        id: kept(&format!("{}{MARK}", given.id)),
        kind: kept(&given.kind),
        cause: kept(&given.cause),
        places: vec![kept(&given.place)],
        is_free_form: given.curve.is_some(),
        is_variant: given.variant,
        is_constant: given.constant,
        parameters: given.parameters.into_iter().map(free).collect(),
        fixed: given.fixed.iter().map(|(name, value)| (kept(name), *value)).collect(),
        starts: given.starts,
    }
}

/// A plant in Python, on the line to the thread that it is called on.
struct Remote<'a> {
    line: &'a Line,
    unit: &'static str,
    channels: Vec<String>,
    bench: [Option<f64>; KINDS],
    signals: &'a [Signal],
    candidates: &'a [Candidate],
    curves: &'a [Option<FreeCurve>],
    runs: &'a [(usize, bool)],
    /// Predicts on the calling thread, for plants that may be called from several threads at a time.
    concurrent: Option<&'a Py<PyAny>>,
}

impl Plant for Remote<'_> {
    fn signals(&self) -> &[Signal] {
        self.signals
    }

    fn channels(&self) -> Vec<String> {
        self.channels.clone()
    }

    fn unit(&self) -> &'static str {
        self.unit
    }

    fn candidates(&self) -> &[Candidate] {
        self.candidates
    }

    fn nuisances(&self, run: usize) -> usize {
        self.runs[run].0
    }

    fn moves_unaided(&self, run: usize) -> bool {
        self.runs[run].1
    }

    fn bench(&self) -> [Option<f64>; KINDS] {
        self.bench
    }

    /// A run of one moment has no clock and no drift.
    fn has_fault(&self, run: usize, kind: usize) -> bool {
        let times = &self.signals[run].times;
        let is_of_time = [Spread::CLOCK, Spread::RATE, Spread::DRIFT].contains(&kind);
        self.bench[kind] != Some(0.0) && !(is_of_time && times.iter().all(|t| *t == times[0]))
    }

    fn curve(&self, term: &Term) -> Option<FreeCurve> {
        let curve = self.curves[term.candidate].as_ref()?;
        let points = curve.points.iter().zip(&term.x).map(|([x, _], y)| [*x, *y]).collect();
        Some(FreeCurve { points, ..curve.clone() })
    }

    fn predict(&self, model: &Model, run: usize, nuisance: &Nuisance) -> Result<Vec<f64>, DiagnoseError> {
        let values = |term: &Term| {
            let parameters = &self.candidates[term.candidate].parameters;
            (term.candidate, parameters.iter().zip(&term.x).map(|(p, x)| p.value(*x)).collect())
        };
        let shares = nuisance.shares.clone();
        let terms = model.terms.iter().map(values).collect();
        let request = Request { run, terms, fine: model.fine, shares, base: nuisance.base };
        let predicted = match self.concurrent {
            None => self.line.predict(request),
            Some(predict) => Python::attach(|py| asked(predict.bind(py), request)).unwrap_or_else(|error| self.line.raise(error)),
        };
        predicted.map_err(DiagnoseError::from)
    }
}

/// The proposal whose values differ most between the first model and the nearest of the others, in words; none without proposals or others.
fn separate(plant: &Remote<'_>, proposals: &[GivenProposal], models: &[Model]) -> Option<String> {
    let [first, others @ ..] = models else { return None };
    let predict = |model: &Model, at: usize| plant.predict(model, plant.signals.len() + at, &Nuisance::default()).ok();
    let distance = |at: usize| {
        let here = predict(first, at)?;
        let from = |other: &Model| {
            let there = predict(other, at)?;
            let differences = here.iter().zip(there).zip(&proposals[at].sigmas).map(|((a, b), sigma)| (a - b) / sigma);
            Some(differences.map(|difference| difference * difference).sum::<f64>().sqrt())
        };
        others.iter().filter_map(from).min_by(f64::total_cmp)
    };
    let all = (0..proposals.len()).filter_map(|at| Some((at, distance(at)?)));
    let (best, distance) = all.max_by(|a, b| a.1.total_cmp(&b.1))?;
    if distance < LEAST_DISTANCE {
        return Some("none of the proposed runs tells them apart".into());
    }
    Some(format!("measure the proposed run {}: the models then differ by {distance:.0} standard deviations", proposals[best].id))
}

/// Asks Python for a prediction: an array, or the reason why there is none.
fn asked(predict: &Bound<'_, PyAny>, request: Request) -> PyResult<Predicted> {
    let Request { run, terms, fine, shares, base } = request;
    let answer = predict.call1((run, terms, fine, shares, base))?;
    match answer.extract::<String>() {
        Ok(reason) => Ok(Err(reason)),
        Err(_) => Ok(Ok(answer.extract::<PyReadonlyArray1<'_, f64>>()?.as_slice()?.to_vec())),
    }
}

/// The diagnosis of a plant: its JSON and files as of `diagnose`. `predict(run, terms, fine, shares, base)` returns an array of the run's values, or a text
/// if the model cannot be simulated; it is called on this thread, or on a number of `threads` at a time. `stopped()` is called when an exception ends
/// the work, before its threads are waited for.
#[pyfunction]
#[pyo3(signature = (given, command, predict, stopped, threads = None, progress = None))]
pub fn diagnose_plant(
    py: Python<'_>,
    given: Bound<'_, PyAny>,
    command: &str,
    predict: Py<PyAny>,
    stopped: Bound<'_, PyAny>,
    threads: Option<i64>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Found> {
    let concurrent = threads.map(|_| &predict);
    let threads = jobs(threads.or(Some(1)))?;
    let Given { name, unit, channels, bench, runs, proposals, candidates } = given.extract()?;
    let unit = kept(&unit);
    let starts: Vec<f64> = runs.iter().map(|run| run.start).collect();
    let kinds: Vec<(usize, bool)> = runs.iter().map(|run| (run.nuisances, run.moves_unaided)).collect();
    let role = |run: &GivenRun| match run.role.as_str() {
        "fit" => Role::Fit,
        "held-out" => Role::HeldOut,
        _ => Role::Auto,
    };
    let roles: Vec<Role> = runs.iter().map(role).collect();
    let signals: Vec<Signal> = runs
        .into_iter()
        .map(|run| Signal {
            id: run.id,
            values: run.values,
            sigmas: run.sigmas,
            times: run.times,
            channels: run.channels,
            inputs: run.inputs,
            is_spectrum: false,
        })
        .collect();
    let free_curve = |given: &GivenCandidate| {
        given.curve.as_ref().map(|curve| FreeCurve {
            x: [kept(&curve.x_name), kept(&curve.x_unit)],
            y: [kept(&curve.y_name), kept(&curve.y_unit)],
            points: curve.x.iter().map(|x| [*x, 0.0]).collect(),
        })
    };
    let curves: Vec<Option<FreeCurve>> = candidates.iter().map(free_curve).collect();
    let candidates: Vec<Candidate> = candidates.into_iter().map(candidate).collect();
    let work = |line: &Line| {
        let plant = Remote {
            line,
            unit,
            channels: channels.clone(),
            bench,
            signals: &signals,
            candidates: &candidates,
            curves: &curves,
            runs: &kinds,
            concurrent,
        };
        let progress = |task: &str| line.progress(&without_mark(task));
        let next = |models: &[Model]| separate(&plant, &proposals, models);
        let outcome = pipeline::diagnose(&plant, &name, &roles, Vec::new(), &progress, &next)?;
        let page = report::page(&outcome, &report::Context { plant: &plant, constants: &[], command, extended: None });
        let residuals = extended::residuals(&plant, &outcome, "", &|run| starts[run]);
        Ok((serde_json::to_string_pretty(&outcome.diagnosis), page, residuals))
    };
    let answer = |py: Python<'_>, call: Call| match call {
        Call::Progress(task) => progress.as_ref().map_or(Ok(()), |progress| progress.call1((task,)).map(drop)),
        Call::Predict(request, reply) => {
            // Nobody waits for the answer where the work has ended.
            asked(predict.bind(py), request).map(|predicted| drop(reply.send(predicted)))
        }
        Call::Raise(error) => Err(error),
    };
    let stopped = |_: Python<'_>| {
        // The exception that stopped the work is the one to be raised.
        let _ = stopped.call0();
    };
    let found: Result<_, DiagnoseError> = serve(py, threads, work, answer, stopped)?;
    let (text, page, residuals) = found.map_err(|error| error::of_diagnosis(&error))?;
    let files = vec![("report.html", without_mark(&page)), ("residuals.csv", without_mark(&residuals))];
    Ok(("diagnosis", without_mark(&json(text)?), files))
}
