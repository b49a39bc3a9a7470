//! Ids of what can be hidden, and families of them.
//!
//! `a`, `a+b`, `a~form`; `several:K` for K effects drawn from the seed; a fault of the bench and a colon before any of these.

use super::bench::{Bench, WORDS};
use super::forms::{FORMS, effect_of, is_for_judging};
use super::random::Random;
use super::{INSIDE, OUTSIDE};

/// What an id stands for.
pub struct Wanted {
    pub bench: Bench,
    pub effects: Vec<String>,
    /// The only size, where the id has one.
    pub only_size: Option<usize>,
}

/// Pairs that no data of the bench can tell apart: they are not drawn together.
const CONFOUNDED: [[&str; 2]; 3] =
    [["stiffness", "areal-mass"], ["time-delay", "sensor-delay"], ["actuation-gain", "passive-margin"]];

/// Effects that are hidden on a faulty bench.
const ON_A_BENCH: [&str; 6] = ["none", "tip-mass", "hysteresis", "creep", "clamp-compliance", "dry-friction"];

/// Reads an id.
pub fn read(id: &str, seed: u64) -> Wanted {
    let (bench, rest) = match id.split_once(':') {
        Some((word, rest)) if WORDS.contains(&word) => (Bench::of(word, seed).unwrap_or_default(), rest),
        _ => (Bench::default(), id),
    };
    if let Some(count) = rest.strip_prefix("several:") {
        let count = count.parse().unwrap_or_else(|_| panic!("{id}: several:K with a number K"));
        return Wanted { bench, effects: several(count, seed), only_size: Some(1) };
    }
    let effects: Vec<String> = rest.split('+').filter(|effect| *effect != "none").map(String::from).collect();
    Wanted { bench, effects, only_size: None }
}

/// Some effects of the library, without pairs that cannot be told apart.
fn several(count: usize, seed: u64) -> Vec<String> {
    let mut random = Random::with_purpose(seed, &format!("several {count}"));
    let mut left = INSIDE.to_vec();
    let mut chosen: Vec<&str> = Vec::new();
    while chosen.len() < count {
        let next = left.swap_remove(random.below(left.len()));
        if !CONFOUNDED.iter().any(|pair| pair.contains(&next) && pair.iter().any(|other| chosen.contains(other))) {
            chosen.push(next);
        }
    }
    chosen.into_iter().map(String::from).collect()
}

/// The ids of a word for a family, or the word itself.
pub fn expand(word: &str) -> Vec<String> {
    match word {
        "forms" => FORMS.iter().map(|form| form.id.into()).collect(),
        "bench" => ON_A_BENCH.iter().map(|id| format!("bench:{id}")).collect(),
        _ => vec![word.into()],
    }
}

/// Sizes of an id out of those asked for: nothing has one size, forms have two, `several` has its own.
pub fn sizes<'a>(id: &str, asked: &'a [usize]) -> &'a [usize] {
    let count = if id.ends_with("none") || id.contains("several:") {
        1
    } else if id.contains('~') {
        asked.iter().take_while(|size| **size < 2).count()
    } else {
        asked.len()
    };
    &asked[..count.min(asked.len())]
}

/// The family that the answers to an id are counted in.
pub fn family(id: &str) -> String {
    let rest = match id.split_once(':') {
        Some(("several", _)) => return id.into(),
        Some((word, "none")) => return format!("{word}:none"),
        Some((word, _)) => return format!("{word}:"),
        None => id,
    };
    let name = match rest {
        "none" => "none",
        _ if OUTSIDE.contains(&rest) => "outside the library",
        _ if rest.contains('+') => "pairs",
        _ if !rest.contains('~') => "inside the library",
        _ if is_for_judging(rest) => "forms for judging",
        _ => "forms for limits",
    };
    name.into()
}

/// The names that the program should say.
pub fn named(effects: &[String]) -> Vec<&str> {
    effects.iter().map(|id| effect_of(id)).collect()
}
