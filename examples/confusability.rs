//! Hides effects in data, diagnoses them, and prints what was said of each as Markdown: the matrices of docs/validation.md.
//!
//! ```sh
//! cargo run --release --example confusability -- [SIZES] [SEEDS] [NOISES_MM] [IDS] [FOLDER]     # lists with commas; by default 0,1,2 1 0.05 all
//! ```
//!
//! With FOLDER every data set is kept there, with its diagnosis.json.
//!
//! The data come from tests/hidden: 11 runs and 37 s of motion of a cantilever, or, for ids after `floor:`, 10 runs and 12 s of motion of a robot
//! on the floor. `floor` stands for all effects that can be hidden there, `turning` for the same with a robot that nothing keeps in its plane
//! (ids after `turning:`), `a+b` for two at once, `several:K` for K effects drawn from the seed.
//!
//! `EFFECT~FORM` is an effect by another equation (tests/hidden/forms.rs), `forms` stands for all of them, in the sizes 0 and 1; it is found if the
//! effect is named. 40 of the 60 forms are only for judging: no limit of the program may be set with them. A fault of the bench comes before any id:
//! `clock:`, `zero:`, `gain:`, `drift:`, `ar:`, `fps60:`, `fps120:`, `sigma2:`, `sigmahalf:`, `nosigma:`, or `bench:` for all of them but the drift
//! (tests/hidden/bench.rs); `bench` stands for some effects on such a bench.

#[path = "../tests/hidden/generator.rs"]
mod generator;
#[path = "../tests/hidden/ground.rs"]
mod ground;
#[path = "../tests/hidden/judge.rs"]
mod judge;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use generator::{Case, DRIFTING_GAIN, INSIDE, OUTSIDE, cases};
use judge::{diagnosed, is_right, physics, range};
use sfers::diagnose::diagnosis::{Adopted, Diagnosis, Verdict};

fn numbers<T: std::str::FromStr + Clone>(argument: Option<&String>, default: &[T]) -> Vec<T> {
    argument.map_or(default.to_vec(), |list| list.split(',').filter_map(|item| item.parse().ok()).collect())
}

/// True parameters of a hidden effect: its name, the parameter's, the value.
type Truth = (String, &'static str, f64);

/// What was hidden: the effects, the trace (mm), and the true parameters.
struct Made {
    effects: Vec<String>,
    trace_mm: f64,
    truths: Vec<Truth>,
}

/// Writes the data of a case.
fn hide(folder: &Path, id: &str, size: usize, seed: u64, noise_mm: f64) -> Made {
    if let Some((place @ ("floor" | "turning"), id)) = id.split_once(':') {
        return hide_on_the_floor(folder, (place, id), size, seed, noise_mm);
    }
    let wanted = cases::read(id, seed);
    let effects: Vec<&str> = wanted.effects.iter().map(String::as_str).collect();
    let case = Case { effects: &effects, size, noise_mm, seed, outliers: false, damaged: false, m: 3 };
    let truth = generator::write_on(folder, &case, &wanted.bench);
    let all =
        truth.hidden.iter().flat_map(|hidden| hidden.parameters.iter().map(|(name, value)| (hidden.id.into(), *name, *value)));
    Made { trace_mm: truth.trace_mm, truths: all.collect(), effects: wanted.effects }
}

fn hide_on_the_floor(folder: &Path, (place, id): (&str, &str), size: usize, seed: u64, noise_mm: f64) -> Made {
    let (mut floor, parameters) =
        if id == "none" { (ground::Floor::default(), Vec::new()) } else { ground::hide(id, size, seed) };
    floor.in_plane = place != "turning";
    let films = ground::film(&floor);
    ground::write(folder, &films, noise_mm, seed);
    Made {
        effects: if id == "none" { Vec::new() } else { vec![id.into()] },
        trace_mm: ground::trace(&films, ground::nominal()),
        truths: parameters.into_iter().map(|(name, value)| (id.into(), name, value)).collect(),
    }
}

/// Answers of a family: how many were as they should be, in how many all causes were named, perhaps with others, and of how many.
#[derive(Default)]
struct Count {
    right: usize,
    named: usize,
    of: usize,
}

/// The ids of the last argument.
fn chosen(argument: Option<&String>) -> Vec<String> {
    let Some(list) = argument else {
        return ["none"].into_iter().chain(INSIDE.iter().copied()).chain(OUTSIDE.iter().copied()).map(String::from).collect();
    };
    let floor = |place: &str| -> Vec<String> {
        ["none"].into_iter().chain(ground::INSIDE.map(|sizes| sizes.id)).map(|id| format!("{place}:{id}")).collect()
    };
    let ids = |word: &str| if matches!(word, "floor" | "turning") { floor(word) } else { cases::expand(word) };
    list.split(',').flat_map(ids).collect()
}

/// Adopted causes with those they are tied with.
fn said(d: &Diagnosis) -> String {
    let of = |effect: &&Adopted| match (&effect.tied_with[..], &effect.nearest[..]) {
        ([], [near, ..]) => format!("{} ({} leaves {:.1} %)", effect.id, near.id, 100.0 * near.left),
        ([], []) => effect.id.clone(),
        (tied, _) => format!("{} (= {})", effect.id, tied.join(", ")),
    };
    physics(d).iter().map(of).collect::<Vec<_>>().join(" + ")
}

/// Whether the ranges of the parameters hold the true values, and words for it.
fn inside(d: &Diagnosis, truths: &[Truth]) -> Vec<(bool, String)> {
    let said = |(id, name, value): &Truth| {
        let [low, high] = range(d, id, name)?;
        let holds = (low..=high).contains(value);
        Some((holds, if holds { "yes".into() } else { format!("no: {value:.4}, not {low:.4} to {high:.4}") }))
    };
    truths.iter().filter_map(said).collect()
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let sizes = numbers(arguments.get(1), &[0_usize, 1, 2]);
    let seeds = numbers(arguments.get(2), &[1_u64]);
    let noises = numbers(arguments.get(3), &[0.05]);
    let ids = chosen(arguments.get(4));
    println!(
        "| hidden | size, noise (mm) | trace (mm) | verdict | found | true value in its range | held-out error / noise | left |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    let mut all = Vec::new();
    for id in &ids {
        for &size in cases::sizes(id, &sizes) {
            for &seed in &seeds {
                all.extend(noises.iter().map(|noise_mm| (id, size, seed, *noise_mm)));
            }
        }
    }
    let (mut right, mut counted, mut inside_range, mut ranges) = (0, 0, 0, 0);
    let mut families = BTreeMap::<String, Count>::new();
    for (id, size, seed, noise_mm) in all {
        let size = cases::read(id, seed).only_size.unwrap_or(size);
        let temporary = tempfile::tempdir().expect("a folder for the data");
        let folder = match arguments.get(5) {
            Some(kept) => Path::new(kept).join(format!("{}-{size}-{seed}-{noise_mm}", id.replace([':', '~'], "-"))),
            None => temporary.path().to_path_buf(),
        };
        std::fs::create_dir_all(&folder).expect("a folder for the data");
        let Made { effects, trace_mm, truths } = hide(&folder, id, size, seed, noise_mm);
        let d = diagnosed(&folder).diagnosis;
        let json = serde_json::to_string_pretty(&d).expect("a diagnosis");
        std::fs::write(folder.join("diagnosis.json"), json).expect("a file in the folder");
        let inside = inside(&d, &truths);
        // A trace below three times the noise need not be found.
        if trace_mm >= 3.0 * noise_mm || effects.is_empty() {
            let is_right = is_expected(&d, &effects);
            counted += 1;
            right += usize::from(is_right);
            ranges += inside.len();
            inside_range += inside.iter().filter(|(holds, _)| *holds).count();
            let family = families.entry(cases::family(id)).or_default();
            family.right += usize::from(is_right);
            family.named += usize::from(is_right || are_named(&d, &effects));
            family.of += 1;
        }
        let drawn = if id.contains("several:") { format!(" ({})", effects.join("+")) } else { String::new() };
        println!(
            "| {id}{drawn} | {size}, {noise_mm} | {trace_mm:.2} | {:?} | {} | {} | {:.2} | {:.1} % |",
            d.verdict,
            said(&d),
            inside.iter().map(|(_, said)| said.as_str()).collect::<Vec<_>>().join(", "),
            d.extended.rmse_heldout_mm / d.noise_mm,
            100.0 * d.unexplained_fraction
        );
    }
    println!(
        "\nAs it should be: {right} of {counted} (where the trace is at least three times the noise); true value in its range: {inside_range} of {ranges}."
    );
    println!("\n| family | as it should be | all causes named, with others, as minor or alone |\n| --- | --- | --- |");
    for (family, Count { right, named, of }) in families {
        println!("| {family} | {right} of {of} | {named} of {of} |");
    }
}

/// True if an adopted cause is the one with an id, or tied with it.
fn is_of(effect: &Adopted, id: &str) -> bool {
    effect.id == id || effect.tied_with.iter().any(|tied| tied.split('+').any(|tied| tied == id))
}

/// True if there are causes, and all of them are named, minor ones included.
fn are_named(d: &Diagnosis, effects: &[String]) -> bool {
    let is_named = |id: &str| d.effects.iter().any(|effect| is_of(effect, id));
    !effects.is_empty() && cases::named(effects).into_iter().all(is_named)
}

/// True if the causes beside minor ones are the hidden ones and no others, each as it is named or as one of those, or of the sets, that it is tied with.
fn are_all(d: &Diagnosis, effects: &[String]) -> bool {
    let hidden: BTreeSet<&str> = cases::named(effects).into_iter().collect();
    let mut together = vec![BTreeSet::new()];
    for effect in physics(d) {
        let of_effect = std::iter::once(&effect.id).chain(&effect.tied_with).map(|set| set.split('+'));
        let of_effect: Vec<BTreeSet<&str>> = of_effect.map(Iterator::collect).filter(|set| hidden.is_superset(set)).collect();
        together = together.iter().flat_map(|others| of_effect.iter().map(move |set| others | set)).collect();
    }
    together.contains(&hidden)
}

/// Nothing where nothing is hidden, a fault of the bench as such, `unexplained` or the right name of what is in no library, and otherwise every hidden cause by name, and
/// no other.
fn is_expected(d: &Diagnosis, effects: &[String]) -> bool {
    match cases::named(effects)[..] {
        [] => d.verdict == Verdict::None,
        [DRIFTING_GAIN] => d.verdict == Verdict::None && d.bench.faults.iter().any(|fault| fault.id == "gain"),
        // Some of them have a namesake in the library, with another equation.
        [id] if OUTSIDE.contains(&id) => matches!(d.verdict, Verdict::Unexplained | Verdict::Located) || is_right(d, id),
        [id] => is_right(d, id),
        _ => !matches!(d.verdict, Verdict::Unexplained | Verdict::None) && are_all(d, effects),
    }
}
