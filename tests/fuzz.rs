//! Inputs of every kind that the program reads, sound and damaged: none may end in a panic, an abort or a hang above 20 s, take more than
//! 2 GB of address space, or give a number that is not finite.
//!
//! The fast suite gives a fixed number of them with a fixed seed. `SFERS_FUZZ_INPUTS` sets the number and `SFERS_FUZZ_SEED` another seed;
//! `bash scripts/fuzz.sh 1000000` is the long run. One input again, with its files in a folder to look at:
//!
//! ```sh
//! SFERS_FUZZ_CASE=experiment:1234 cargo test --release --test fuzz one_case -- --exact --ignored --nocapture
//! ```

mod common;

#[path = "fuzz/command.rs"]
mod command;
#[path = "fuzz/data.rs"]
mod data;
#[path = "fuzz/experiments.rs"]
mod experiments;
#[path = "fuzz/files.rs"]
mod files;
#[path = "fuzz/kinds.rs"]
mod kinds;
#[path = "fuzz/outputs.rs"]
mod outputs;
#[path = "fuzz/random.rs"]
mod random;
#[path = "fuzz/results.rs"]
mod results;
#[path = "fuzz/settings.rs"]
mod settings;
#[path = "fuzz/supervise.rs"]
mod supervise;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use kinds::{KINDS, Kind, PLANTED};
use supervise::Finding;

/// Inputs of the fast suite; `scripts/test.sh` gives 20,000.
const INPUTS: u64 = 1_000;
const SEED: u64 = 1;

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().unwrap_or_else(|_| panic!("{name} is no number: {text}")))
}

/// Alike findings under one line, with the first cases of each.
fn describe(findings: &[Finding], seed: u64) -> String {
    let mut groups: BTreeMap<(&str, String), Vec<&Finding>> = BTreeMap::new();
    for finding in findings {
        let short: String = finding.symptom.chars().filter(|c| !c.is_ascii_digit()).take(90).collect();
        groups.entry((finding.kind, short)).or_default().push(finding);
    }
    let line = |((kind, _), group): (&(&str, String), &Vec<&Finding>)| {
        let cases: Vec<String> = group.iter().take(4).map(|finding| format!("{kind}:{}:{seed}", finding.case)).collect();
        format!("{} times {:.300}\n    SFERS_FUZZ_CASE={}\n", group.len(), group[0].symptom, cases.join(" or "))
    };
    groups.iter().map(line).collect()
}

#[test]
fn no_input_ends_in_a_panic_an_abort_a_hang_too_much_memory_or_a_number_that_is_not_finite() {
    let (inputs, seed) = (number("SFERS_FUZZ_INPUTS", INPUTS), number("SFERS_FUZZ_SEED", SEED));
    let only = std::env::var("SFERS_FUZZ_KIND").ok();
    let chosen: Vec<&'static Kind> = KINDS.iter().filter(|kind| only.as_ref().is_none_or(|only| only == kind.name)).collect();
    let whole: u64 = chosen.iter().map(|kind| kind.share).sum();
    let counts: Vec<_> = chosen.iter().map(|&kind| (kind, (inputs * kind.share).div_ceil(whole))).collect();
    let start = Instant::now();
    let (tallies, findings) = supervise::run(&counts, seed, supervise::LIMIT);
    let given: u64 = tallies.values().map(|tally| tally.inputs).sum();
    println!("{}\n{given} inputs of seed {seed} in {:.0} s", supervise::table(&tallies, &counts), start.elapsed().as_secs_f64());
    assert!(findings.is_empty(), "{} inputs went wrong:\n{}", findings.len(), describe(&findings, seed));
    assert!(given >= inputs, "only {given} of {inputs} inputs were given");
    for (name, tally) in &tallies {
        // A generator that makes nothing sound, or nothing damaged, tests half of what it should.
        assert!(tally.inputs < 200 || (tally.accepted > 0 && tally.refused > 0), "{name}: {tally:?}");
    }
}

#[test]
fn a_planted_panic_hang_abort_allocation_and_nan_are_each_found_at_their_input() {
    let counts: Vec<_> = PLANTED.iter().map(|kind| (kind, if kind.name == "planted-hang" { 12 } else { 40 })).collect();
    let (tallies, findings) = supervise::run(&counts, 5, Duration::from_secs(2));
    for (kind, count) in counts {
        let word = match kind.name {
            "planted-panic" => "panic at tests/fuzz/kinds.rs",
            "planted-hang" => "hang",
            "planted-abort" => "abort: signal 6",
            "planted-memory" => "memory allocation of 3221225472 bytes failed",
            _ => "not finite: planted",
        };
        // The planted targets go wrong where the first random number behind the input says so.
        let expected: Vec<u64> = (0..count).filter(|&case| random::Random::new(5, kind.name, case).once_in(7)).collect();
        let found: Vec<&Finding> = findings.iter().filter(|finding| finding.kind == kind.name).collect();
        assert!(!expected.is_empty(), "{} never goes wrong", kind.name);
        assert_eq!(found.iter().map(|finding| finding.case).collect::<Vec<_>>(), expected, "{}", kind.name);
        assert!(found.iter().all(|finding| finding.symptom.contains(word)), "{found:?}");
        let tally = tallies[kind.name];
        let well = tally.accepted + tally.refused + tally.failed;
        assert_eq!((tally.inputs, well), (count, count - expected.len() as u64), "{}: {tally:?}", kind.name);
    }
}

#[test]
#[ignore = "no test: the work of a process that the tests above start"]
fn worker_process() {
    // With the stack of a program's first thread.
    let thread = std::thread::Builder::new().stack_size(8 << 20).spawn(supervise::worker).unwrap();
    assert!(thread.join().unwrap(), "SFERS_FUZZ_JOB is not set");
}

#[test]
#[ignore = "no test: repeats the input of SFERS_FUZZ_CASE=KIND:CASE[:SEED]"]
fn one_case() {
    let Ok(text) = std::env::var("SFERS_FUZZ_CASE") else { panic!("set SFERS_FUZZ_CASE=KIND:CASE[:SEED]") };
    let parts: Vec<&str> = text.split(':').collect();
    let (kind, case) = (parts[0], parts[1].parse().unwrap());
    let seed = parts.get(2).map_or(SEED, |seed| seed.parse().unwrap());
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fuzz").join(format!("{kind}-{case}-{seed}"));
    std::fs::create_dir_all(&folder).unwrap();
    let input = supervise::input(kind, seed, case);
    input.write(&folder).unwrap();
    println!("{}: {:?}", folder.display(), input.words);
    let start = Instant::now();
    let fate = supervise::again(kind, seed, case);
    println!("{fate:?} in {:.2} s", start.elapsed().as_secs_f64());
    fate.unwrap();
}
