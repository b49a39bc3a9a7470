//! `sfers run` of an experiment with `[ensemble]`.

use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Instant;

use serde_json::{Map, Value, json};

use super::super::output::{finish, pending};
use super::super::{Failure, INTERRUPTED, Options, print, say};
use super::{Args, INTERRUPT, six_digits};
use crate::experiment::{Source, ensemble};
use crate::recording::definitions;
use crate::recording::measures::Measures;

/// Runs all members and prints the spread of every measure that all of them have.
pub fn run(args: &Args, source: &Source, options: Options) -> Result<ExitCode, Failure> {
    for (option, given) in [
        ("--robot", args.robot.is_some()),
        ("--save-state", args.save_state.is_some()),
        ("--load-state", args.load_state.is_some()),
    ] {
        if given {
            return Err(Failure::Usage(format!(
                "{option} is for one run, and {} has [ensemble]; remove one of the two",
                source.name
            )));
        }
    }
    if let Some(path) = args.out.as_deref().filter(|path| path.extension().is_none_or(|extension| extension != "csv")) {
        return Err(Failure::Usage(format!(
            "--out {}: an ensemble has many recordings; give FILE.csv for the measures of its members",
            path.display()
        )));
    }
    let mut members = ensemble::members(source)?;
    members.iter_mut().for_each(|member| member.record_only_what_measures_need(&definitions::names()));
    let output = args.out.as_deref().map(pending).transpose()?;
    let _ = ctrlc::set_handler(|| INTERRUPT.store(true, Ordering::Relaxed));
    let start = Instant::now();
    let measures = ensemble::run_members(&members, &|| INTERRUPT.load(Ordering::Relaxed)).map_err(Failure::Simulation)?;
    let Some(measures) = measures else {
        say("interrupted: an ensemble gives no measures before all members have run");
        return Ok(ExitCode::from(INTERRUPTED));
    };
    let wall = start.elapsed().as_secs_f64();
    if let Some(file) = output {
        finish(file, table(&measures).as_bytes())?;
    }
    print(&described(&measures, args.out.as_deref(), wall, options))?;
    options.remark(&format!("{} members in {wall:.2} s", members.len()));
    Ok(ExitCode::SUCCESS)
}

/// A row of measures for each member.
fn table(measures: &[Measures]) -> String {
    let names: Vec<&str> =
        definitions::names().into_iter().filter(|name| measures.iter().any(|m| m.get(name).is_some())).collect();
    let mut text = format!("member,{}\n", names.join(","));
    for (index, member) in measures.iter().enumerate() {
        let cells: Vec<String> =
            names.iter().map(|name| member.get(name).map_or_else(String::new, |value| format!("{value:?}"))).collect();
        text += &format!("{index},{}\n", cells.join(","));
    }
    text
}

/// The spreads as text, or the JSON object of `--json`.
fn described(measures: &[Measures], saved: Option<&Path>, wall: f64, options: Options) -> String {
    let spreads = definitions::names().into_iter().filter_map(|name| Some((name, ensemble::spread(measures, name)?)));
    if options.json {
        let spreads: Map<String, Value> = spreads.map(|(name, spread)| (name.to_owned(), json!(spread))).collect();
        let object = json!({"schema": 1, "members": measures.len(), "ensemble": spreads, "out": saved, "wall_s": wall});
        return format!("{object}\n");
    }
    let line = |(name, s): (&str, crate::experiment::Spread)| {
        let [mean, sd, low, _, high] = s.values().map(six_digits);
        format!("{name} = {mean} (sd {sd}, 5 to 95 %: {low} to {high})\n")
    };
    spreads.map(line).collect()
}
