//! What the examples on measured data share: columns of NPZ files, candidates in a line each, the diagnosis in words.

#![allow(dead_code)] // every example takes a part of it

use std::error::Error;
use std::fs::File;
use std::path::{Path, PathBuf};

use ndarray::Array1;
use ndarray_npy::NpzReader;
use sfers::diagnose::DiagnoseError;
use sfers::diagnose::dataset::Role;
use sfers::diagnose::pipeline::{Outcome, diagnose};
use sfers::diagnose::plant::{Candidate, Free, Model, Nuisance, Plant};

/// The folder of the data, the first argument of the command; none, with a line that says so, if it is absent.
pub fn folder(name: &str) -> Option<PathBuf> {
    let root = std::env::args().nth(1).unwrap_or_else(|| "../shared/real".into());
    let folder = Path::new(&root).join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: the measured data {} are absent", folder.display());
    None
}

/// A column of an NPZ file.
///
/// # Errors
/// If the file has no such column of numbers.
pub fn column(path: &Path, key: &str) -> Result<Vec<f64>, Box<dyn Error>> {
    let named = |error: &dyn std::fmt::Display| format!("{}, {key}: {error}", path.display());
    let mut file = NpzReader::new(File::open(path).map_err(|e| named(&e))?).map_err(|e| named(&e))?;
    let array: Array1<f64> = file.by_name(key).map_err(|e| named(&e))?;
    Ok(array.to_vec())
}

/// A fitted parameter with the value at which it has no effect.
pub fn free(name: &'static str, unit: &'static str, off: f64, bounds: [f64; 2], scale: f64) -> Free {
    Free { name, unit, off: Some(off), bounds, scale, inverse: false }
}

/// A fitted parameter that does not switch its cause off.
pub fn shape(name: &'static str, unit: &'static str, bounds: [f64; 2], scale: f64) -> Free {
    Free { name, unit, off: None, bounds, scale, inverse: false }
}

/// A cause with one parameter, which has no effect at 0; the search starts at `scale`.
pub fn one(
    id: &'static str,
    cause: &'static str,
    name: &'static str,
    unit: &'static str,
    bounds: [f64; 2],
    scale: f64,
) -> Candidate {
    candidate(id, cause, vec![free(name, unit, 0.0, bounds, scale)], &[&[scale]])
}

/// Causes that act at one place of the model: rivals.
pub fn at<const N: usize>(place: &'static str, causes: [Candidate; N]) -> Vec<Candidate> {
    causes.into_iter().map(|cause| Candidate { places: vec![place], ..cause }).collect()
}

/// A constant of the nominal model, `parameter` with its nominal value as the one without effect.
pub fn constant(id: &'static str, cause: &'static str, parameter: Free) -> Candidate {
    let start = parameter.off.unwrap_or(parameter.bounds[0]) + parameter.scale;
    Candidate { is_constant: true, kind: "calibration", ..candidate(id, cause, vec![parameter], &[&[start]]) }
}

/// A cause that may be added to the model.
pub fn candidate(id: &'static str, cause: &'static str, parameters: Vec<Free>, starts: &[&[f64]]) -> Candidate {
    Candidate {
        id,
        kind: "physics",
        cause,
        places: vec![id],
        is_free_form: false,
        is_constant: false,
        parameters,
        fixed: Vec::new(),
        starts: starts.iter().map(|start| start.to_vec()).collect(),
    }
}

/// The coordinate of parameter `name` of cause `id`; none if the model does not have it.
pub fn value(candidates: &[Candidate], model: &Model, id: &str, name: &str) -> Option<f64> {
    model.terms.iter().find_map(|term| {
        let candidate = &candidates[term.candidate];
        let at = candidate.parameters.iter().position(|p| p.name == name)?;
        (candidate.id == id).then_some(term.x[at])
    })
}

/// Diagnoses a plant, with every task on standard error if `SFERS_VERBOSE` is set.
///
/// # Errors
/// As [`diagnose`].
pub fn found(plant: &dyn Plant, name: &str, roles: &[Role]) -> Result<Outcome, DiagnoseError> {
    let is_verbose = std::env::var_os("SFERS_VERBOSE").is_some();
    let progress = |task: &str| {
        if is_verbose {
            eprintln!("{task}");
        }
    };
    diagnose(plant, name, roles, Vec::new(), &progress, &|_| None)
}

/// Residuals of a model on runs of a plant, and the measured values, in the plant's unit.
///
/// # Errors
/// If the model cannot be simulated.
pub fn residuals(plant: &dyn Plant, model: &Model, runs: &[usize]) -> Result<(Vec<f64>, Vec<f64>), DiagnoseError> {
    let (mut rest, mut measured) = (Vec::new(), Vec::new());
    for run in runs {
        let values = &plant.signals()[*run].values;
        let predicted = plant.predict(model, *run, &Nuisance::default())?;
        rest.extend(values.iter().zip(predicted).map(|(y, f)| y - f));
        measured.extend(values);
    }
    Ok((rest, measured))
}

/// Root mean square.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Prints the verdict, the parameters, the errors of each run, the ranking and the residual tests that fail; writes all of it as JSON to the second
/// argument of the command, if there is one.
///
/// # Errors
/// If the file cannot be written.
pub fn print(outcome: &Outcome, unit: &str) -> Result<(), Box<dyn Error>> {
    let d = &outcome.diagnosis;
    println!("{:?}: {}", d.verdict, d.summary);
    for line in d.unexplained.iter().chain(&d.remarks) {
        println!("  {line}");
    }
    println!("left of the misfit {:.2} %, noise {:.4} {unit}", 100.0 * d.unexplained_fraction, d.noise_mm);
    for effect in &d.effects {
        let parameters: Vec<String> = effect
            .parameters
            .iter()
            .map(|p| {
                let [low, high] = p.ci95.map(|end| end.map_or_else(|| "open".to_owned(), |end| format!("{end:.5}")));
                format!("{} {:.5} ({low} to {high}) {}{}", p.name, p.value, p.unit, if p.at_bound { ", at a bound" } else { "" })
            })
            .collect();
        let tied =
            if effect.tied_with.is_empty() { String::new() } else { format!(", tied with {}", effect.tied_with.join(", ")) };
        println!(
            "  {} [{:?}, {:.2} % of the misfit{tied}]: {}",
            effect.id,
            effect.role,
            100.0 * effect.share,
            parameters.join("; ")
        );
    }
    println!("{:28} {:>9} {:>11} {:>11} {:>11}", format!("rms error ({unit})"), "role", "nominal", "re-tuned", "extended");
    for ((nominal, tuned), extended) in d.baseline.runs.iter().zip(&d.calibrated.runs).zip(&d.extended.runs) {
        println!(
            "{:28} {:>9} {:11.4} {:11.4} {:11.4}",
            nominal.id, nominal.role, nominal.rmse_mm, tuned.rmse_mm, extended.rmse_mm
        );
    }
    let [nominal, tuned, extended] = [&d.baseline, &d.calibrated, &d.extended].map(|stage| stage.rmse_heldout_mm);
    println!("{:28} {:>9} {nominal:11.4} {tuned:11.4} {extended:11.4}", "all held-out", "");
    for ranked in &d.candidates {
        println!(
            "  alone: {} {} {:.4} {unit}, change of BIC {:.0}",
            ranked.id, ranked.form, ranked.rmse_heldout_mm, ranked.delta_bic
        );
    }
    let tests = &d.extended.residual_tests;
    println!("{} of {} residual tests fail", tests.iter().filter(|test| !test.passed).count(), tests.len());
    if let Some(path) = std::env::args().nth(2) {
        std::fs::write(path, serde_json::to_string_pretty(d)?)?;
    }
    Ok(())
}
