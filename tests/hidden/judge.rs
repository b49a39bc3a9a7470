//! Diagnoses data in a folder, and says whether the hidden cause was found.

#![allow(dead_code, unused_imports)] // every user takes a part of it

#[path = "../common/long.rs"]
mod long;

use std::path::Path;

pub use long::long;
use sfers::diagnose::dataset::Dataset;
use sfers::diagnose::diagnosis::{Adopted, Diagnosis, Part, Verdict};
use sfers::diagnose::pipeline::{Outcome, diagnose};
use sfers::diagnose::plant::Model;
use sfers::diagnose::robot::RobotPlant;
use sfers::diagnose::{protocols, quality};

/// Diagnoses a data set as `sfers diagnose` does.
pub fn diagnosed(folder: &Path) -> Outcome {
    let set = Dataset::read(&folder.join("dataset.toml")).expect("the generator's own data");
    let checked = quality::check(&set);
    let plant = RobotPlant::new(&set, &checked);
    let roles: Vec<_> = set.runs.iter().map(|run| run.role).collect();
    let separate = |models: &[Model]| protocols::separate(&plant, models);
    diagnose(&plant, "case", &roles, checked.remarks, &|_| {}, &separate).expect("the nominal model runs")
}

/// Causes that motion alone cannot tell apart (docs/validation.md): one name of a line stands for all.
const INSEPARABLE: [&[&str]; 2] = [&["stiffness", "areal-mass"], &["time-delay", "sensor-delay"]];

/// Causes beside the discretisation, without minor ones.
pub fn physics(d: &Diagnosis) -> Vec<&Adopted> {
    d.effects.iter().filter(|effect| effect.id != "discretisation" && effect.role == Part::Cause).collect()
}

/// Their names.
pub fn names(d: &Diagnosis) -> Vec<&str> {
    physics(d).iter().map(|effect| effect.id.as_str()).collect()
}

/// True if the hidden cause is named, alone, or tied within what cannot be told apart.
pub fn is_right(d: &Diagnosis, hidden: &str) -> bool {
    let [effect] = physics(d)[..] else { return false };
    let set = INSEPARABLE.iter().find(|set| set.contains(&hidden)).copied().unwrap_or_default();
    // A set of two that holds the cause leaves open what is beside it.
    let allowed = |tied: &str| tied.split('+').any(|id| id == hidden || set.contains(&id));
    let is_nearest = effect.nearest.first().is_some_and(|near| allowed(&near.id));
    if d.verdict == Verdict::Located {
        return is_nearest;
    }
    matches!(d.verdict, Verdict::Named | Verdict::Tied)
        && allowed(&effect.id)
        && effect.tied_with.iter().all(|id| allowed(id))
        && (effect.id == hidden || effect.tied_with.iter().any(|id| id == hidden))
}

/// The range of a parameter of the cause; none if it is not named or an end is missing.
pub fn range(d: &Diagnosis, hidden: &str, parameter: &str) -> Option<[f64; 2]> {
    let of_cause = physics(d).into_iter().filter(|effect| effect.id == hidden);
    let [low, high] = of_cause.flat_map(|effect| &effect.parameters).find(|p| p.name == parameter)?.ci95;
    Some([low?, high?])
}

/// True if it holds the true value.
pub fn holds(d: &Diagnosis, hidden: &str, parameter: &str, value: f64) -> Option<bool> {
    range(d, hidden, parameter).map(|[low, high]| low <= value && value <= high)
}
