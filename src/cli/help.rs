//! `sfers help`: commands, keys of files, measures.

use std::process::ExitCode;

use clap::CommandFactory;
use serde_json::json;

use super::{Cli, Failure, Options, print};
use crate::keys;
use crate::recording::definitions::{CONVENTIONS, DEFINITIONS, Definition};
use crate::words::did_you_mean;

/// Explain a command, the keys of files or the measures.
///
/// `sfers help keys` lists every key of experiment, sweep and dataset files with unit, default and range, `sfers help keys drive` those of a
/// table, `sfers help keys damping` those with such a name; `sfers help measures` defines every measure.
///
/// Example: sfers help keys robot.friction
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A command, `keys` or `measures`.
    topic: Option<String>,
    /// With `keys` and `measures`: a table or a part of a name.
    part: Option<String>,
    /// Keys and measures as Markdown, as in docs/keys.md and docs/measures.md.
    #[arg(long)]
    markdown: bool,
}

pub fn run(args: &Args, options: Options) -> Result<ExitCode, Failure> {
    let part = args.part.as_deref();
    let text = match args.topic.as_deref() {
        None => commands(),
        Some("keys") if options.json => format!("{}\n", keys::json()),
        Some("keys") if args.markdown => keys::markdown(),
        Some("keys") => keys::text(part),
        Some("measures") if options.json => format!("{}\n", measures_json()),
        Some("measures") if args.markdown => measures_markdown(),
        Some("measures") => measures(part),
        Some(topic) => command(topic)?,
    };
    if text.is_empty() {
        let known: Vec<_> = keys::FILES.iter().flat_map(|file| file.sections).flat_map(|s| s.keys).map(|key| key.name).collect();
        let known = known.into_iter().chain(DEFINITIONS.iter().map(|definition| definition.name));
        let part = part.unwrap_or_default();
        return Err(Failure::Usage(format!("no name contains {part:?}{}", did_you_mean(part, known))));
    }
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// The overview of commands and topics.
fn commands() -> String {
    let overview = Cli::command().render_long_help();
    format!("{overview}\nMore: sfers help COMMAND, sfers help keys, sfers help measures\n")
}

/// The help of a command, as by `sfers COMMAND --help`.
fn command(name: &str) -> Result<String, Failure> {
    let mut all = Cli::command();
    // Gives the subcommands their full names and the global options.
    all.build();
    let known: Vec<String> = all.get_subcommands().map(|command| command.get_name().to_owned()).collect();
    let hint = did_you_mean(name, known.iter().map(String::as_str).chain(["keys", "measures"]));
    match all.find_subcommand_mut(name) {
        Some(found) => Ok(found.render_long_help().to_string()),
        None => {
            Err(Failure::Usage(format!("there is no help on {name:?}{hint}; there is on keys, measures, {}", known.join(", "))))
        }
    }
}

fn measures(part: Option<&str>) -> String {
    let shown = DEFINITIONS.iter().filter(|definition| part.is_none_or(|part| definition.name.contains(part)));
    let entry =
        |d: &Definition| format!("{}\n{}{}", d.name, keys::wrapped(d.about, 4), keys::wrapped(&format!("For {}.", d.of), 4));
    let entries: String = shown.map(entry).collect();
    if entries.is_empty() { entries } else { format!("{}\n{entries}", keys::wrapped(CONVENTIONS, 0)) }
}

fn measures_markdown() -> String {
    let row = |d: &Definition| format!("| `{}` | {} | {} | {} |\n", d.name, keys::unit(d.name), d.of, d.about);
    format!(
        "# Measures\n\nMade by `sfers help measures --markdown`.\n\n{CONVENTIONS}\n\n| measure | unit | of | definition |\n| --- | --- | --- | --- |\n{}",
        DEFINITIONS.iter().map(row).collect::<String>()
    )
}

fn measures_json() -> serde_json::Value {
    let entry = |d: &Definition| json!({"name": d.name, "unit": keys::unit(d.name), "of": d.of, "definition": d.about});
    json!({"schema": 1, "conventions": CONVENTIONS, "measures": DEFINITIONS.iter().map(entry).collect::<Vec<_>>()})
}
