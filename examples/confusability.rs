//! Hides effects in data, diagnoses them, and prints what was said of each as Markdown: the matrix of docs/validation.md.
//!
//! ```sh
//! cargo run --release --example confusability -- [SIZES] [SEEDS] [NOISES_MM] [IDS]     # lists with commas; by default 0,1,2 1 0.05 all
//! ```
//!
//! The data come from tests/hidden, a simulator of its own. Every case is a data set of 11 runs and 37 s of motion.

#[path = "../tests/hidden/generator.rs"]
mod generator;

use generator::{Case, INSIDE, OUTSIDE};
use sfers::diagnose::dataset::Dataset;
use sfers::diagnose::quality;
use sfers::diagnose::robot::RobotPlant;
use sfers::diagnose::verdict::diagnose;

fn numbers<T: std::str::FromStr + Clone>(argument: Option<&String>, default: &[T]) -> Vec<T> {
    argument.map_or(default.to_vec(), |list| list.split(',').filter_map(|item| item.parse().ok()).collect())
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let sizes = numbers(arguments.get(1), &[0_usize, 1, 2]);
    let seeds = numbers(arguments.get(2), &[1_u64]);
    let noises = numbers(arguments.get(3), &[0.05]);
    let all: Vec<&str> = ["none"].into_iter().chain(INSIDE.iter().copied()).chain(OUTSIDE.iter().copied()).collect();
    let ids: Vec<&str> = arguments.get(4).map_or(all, |list| list.split(',').collect());
    println!(
        "| hidden | size, noise (mm) | trace (mm) | verdict | found | true value in its range | held-out error / noise | left |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    let mut cases = Vec::new();
    for id in ids {
        for &size in &sizes {
            for &seed in &seeds {
                cases.extend(noises.iter().map(|noise_mm| (id, size, seed, *noise_mm)));
            }
        }
    }
    for (id, size, seed, noise_mm) in cases {
        let effects: Vec<&str> = id.split('+').filter(|id| *id != "none").collect();
        let folder = tempfile::tempdir().expect("a folder for the data");
        let case = Case { effects: &effects, size, noise_mm, seed, outliers: false, damaged: false, m: 3 };
        let truth = generator::write(folder.path(), &case);
        let set = Dataset::read(&folder.path().join("dataset.toml")).expect("the generator's own data");
        let checked = quality::check(&set);
        let plant = RobotPlant::new(&set, &checked);
        let roles: Vec<_> = set.runs.iter().map(|run| run.role).collect();
        let outcome = diagnose(&plant, id, &roles, checked.remarks, &|_| {}, &|_| None).expect("the nominal model runs");
        let d = outcome.diagnosis;
        let physics: Vec<_> = d.effects.iter().filter(|effect| effect.id != "discretisation").collect();
        let found: Vec<String> = physics
            .iter()
            .map(|effect| {
                if effect.tied_with.is_empty() {
                    effect.id.clone()
                } else {
                    format!("{} (= {})", effect.id, effect.tied_with.join(", "))
                }
            })
            .collect();
        let mut inside = Vec::new();
        for hidden in &truth.hidden {
            for (name, value) in &hidden.parameters {
                let estimate = physics
                    .iter()
                    .filter(|effect| effect.id == hidden.id)
                    .flat_map(|effect| &effect.parameters)
                    .find(|p| p.name == *name);
                if let Some([Some(low), Some(high)]) = estimate.map(|estimate| estimate.ci95) {
                    inside.push(if low <= *value && *value <= high { "yes" } else { "no" });
                }
            }
        }
        println!(
            "| {id} | {size}, {noise_mm} | {:.2} | {:?} | {} | {} | {:.2} | {:.1} % |",
            truth.trace_mm,
            d.verdict,
            found.join(" + "),
            inside.join(", "),
            d.extended.rmse_heldout_mm / d.noise_mm,
            100.0 * d.unexplained_fraction
        );
    }
}
