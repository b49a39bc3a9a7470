//! Hides effects in data, diagnoses them, and prints what was said of each as Markdown: the matrices of docs/validation.md.
//!
//! ```sh
//! cargo run --release --example confusability -- [SIZES] [SEEDS] [NOISES_MM] [IDS]     # lists with commas; by default 0,1,2 1 0.05 all
//! ```
//!
//! The data come from tests/hidden: 11 runs and 37 s of motion of a cantilever, or, for ids after `floor:`, 10 runs and 12 s of motion of a robot
//! on the floor. `floor` stands for all effects that can be hidden there, `turning` for the same with a robot that nothing keeps in its plane
//! (ids after `turning:`), `a+b` for two at once.

#[path = "../tests/hidden/generator.rs"]
mod generator;
#[path = "../tests/hidden/ground.rs"]
mod ground;
#[path = "../tests/hidden/judge.rs"]
mod judge;

use std::path::Path;

use generator::{Case, INSIDE, OUTSIDE};
use judge::{diagnosed, is_right, physics, range};
use sfers::diagnose::diagnosis::{Diagnosis, Verdict};

fn numbers<T: std::str::FromStr + Clone>(argument: Option<&String>, default: &[T]) -> Vec<T> {
    argument.map_or(default.to_vec(), |list| list.split(',').filter_map(|item| item.parse().ok()).collect())
}

/// True parameters of a hidden effect: its name, the parameter's, the value.
type Truth = (String, &'static str, f64);

/// Writes the data of a case: the trace (mm) of what is hidden in them, and the true values.
fn hide(folder: &Path, id: &str, size: usize, seed: u64, noise_mm: f64) -> (f64, Vec<Truth>) {
    if let Some((place, id)) = id.split_once(':') {
        let (mut floor, parameters) =
            if id == "none" { (ground::Floor::default(), Vec::new()) } else { ground::hide(id, size, seed) };
        floor.in_plane = place != "turning";
        let films = ground::film(&floor);
        ground::write(folder, &films, noise_mm, seed);
        return (
            ground::trace(&films, ground::nominal()),
            parameters.into_iter().map(|(name, value)| (id.into(), name, value)).collect(),
        );
    }
    let effects: Vec<&str> = id.split('+').filter(|id| *id != "none").collect();
    let case = Case { effects: &effects, size, noise_mm, seed, outliers: false, damaged: false, m: 3 };
    let truth = generator::write(folder, &case);
    let all =
        truth.hidden.iter().flat_map(|hidden| hidden.parameters.iter().map(|(name, value)| (hidden.id.into(), *name, *value)));
    (truth.trace_mm, all.collect())
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let sizes = numbers(arguments.get(1), &[0_usize, 1, 2]);
    let seeds = numbers(arguments.get(2), &[1_u64]);
    let noises = numbers(arguments.get(3), &[0.05]);
    let all = || ["none"].into_iter().chain(INSIDE.iter().copied()).chain(OUTSIDE.iter().copied()).map(String::from).collect();
    let floor = |place: &str| -> Vec<String> {
        ["none"].into_iter().chain(ground::INSIDE.map(|sizes| sizes.id)).map(|id| format!("{place}:{id}")).collect()
    };
    let ids: Vec<String> = match arguments.get(4).map(String::as_str) {
        None => all(),
        Some(place @ ("floor" | "turning")) => floor(place),
        Some(list) => list.split(',').map(String::from).collect(),
    };
    println!(
        "| hidden | size, noise (mm) | trace (mm) | verdict | found | true value in its range | held-out error / noise | left |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    let mut cases = Vec::new();
    for id in &ids {
        // Nothing has one size.
        for &size in if id.ends_with("none") { &sizes[..1] } else { &sizes } {
            for &seed in &seeds {
                cases.extend(noises.iter().map(|noise_mm| (id, size, seed, *noise_mm)));
            }
        }
    }
    let (mut right, mut counted, mut inside_range, mut ranges) = (0, 0, 0, 0);
    for (id, size, seed, noise_mm) in cases {
        let folder = tempfile::tempdir().expect("a folder for the data");
        let (trace_mm, truths) = hide(folder.path(), id, size, seed, noise_mm);
        let d = diagnosed(folder.path()).diagnosis;
        let found: Vec<String> = physics(&d)
            .iter()
            .map(|effect| {
                if effect.tied_with.is_empty() {
                    effect.id.clone()
                } else {
                    format!("{} (= {})", effect.id, effect.tied_with.join(", "))
                }
            })
            .collect();
        let inside: Vec<(bool, String)> = truths
            .iter()
            .filter_map(|(id, name, value)| {
                let [low, high] = range(&d, id, name)?;
                let holds = (low..=high).contains(value);
                Some((holds, if holds { "yes".into() } else { format!("no: {value:.4}, not {low:.4} to {high:.4}") }))
            })
            .collect();
        // A trace below three times the noise need not be found.
        if trace_mm >= 3.0 * noise_mm || truths.is_empty() {
            counted += 1;
            right += usize::from(is_expected(&d, id));
            ranges += inside.len();
            inside_range += inside.iter().filter(|(holds, _)| *holds).count();
        }
        println!(
            "| {id} | {size}, {noise_mm} | {trace_mm:.2} | {:?} | {} | {} | {:.2} | {:.1} % |",
            d.verdict,
            found.join(" + "),
            inside.iter().map(|(_, said)| said.as_str()).collect::<Vec<_>>().join(", "),
            d.extended.rmse_heldout_mm / d.noise_mm,
            100.0 * d.unexplained_fraction
        );
    }
    println!(
        "\nAs it should be: {right} of {counted} (where the trace is at least three times the noise); true value in its range: {inside_range} of {ranges}."
    );
}

/// Nothing where nothing is hidden, `unexplained` of what is in no library, and otherwise every hidden cause by name.
fn is_expected(d: &Diagnosis, id: &str) -> bool {
    let id = id.split_once(':').map_or(id, |(_, id)| id);
    match id {
        "none" => d.verdict == Verdict::None,
        _ if OUTSIDE.contains(&id) => d.verdict == Verdict::Unexplained,
        _ if id.contains('+') => {
            let is_named =
                |id: &str| d.effects.iter().any(|effect| effect.id == id || effect.tied_with.iter().any(|tied| tied == id));
            d.verdict != Verdict::Unexplained && id.split('+').all(is_named)
        }
        _ => is_right(d, id),
    }
}
