//! `sfers animate`: a recording as a page that plays it, or as a GIF.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::output::{finish, pending};
use super::plot::{self, extension};
use super::run::source;
use super::{Failure, Options, say};
use crate::experiment::{self, Control, presets};
use crate::view;

/// Animate a recording: FILE.html plays, scrubs and shows voltages; FILE.gif is a film.
///
/// Example: sfers animate jump.npz --out jump.html
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A recording, FILE.npz (this program's or the reference's) or FILE.csv (this program's); or an experiment, which is run first:
    /// FILE.toml, `-` for standard input, preset:NAME, or NAME where there is no such file.
    input: PathBuf,
    /// FILE.html or FILE.gif.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Initial speed (1: real time); by default one for a duration of some seconds.
    #[arg(long, value_name = "X", value_parser = speed)]
    speed: Option<f64>,
}

/// True if the input is an experiment, false if it is a recording.
fn is_experiment(input: &Path) -> bool {
    let name = input.to_str().unwrap_or_default();
    let built_in = name.starts_with("preset:") || (!input.exists() && presets::text_of(name).is_some());
    built_in || name == "-" || extension(input) == "toml"
}

fn speed(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|speed: &f64| speed.is_finite() && *speed > 0.0).ok_or_else(|| "must be a positive number".into())
}

pub fn run(args: &Args, options: Options) -> Result<ExitCode, Failure> {
    let kind = extension(&args.out);
    if !["html", "gif"].contains(&kind) {
        return Err(Failure::Usage(format!("{}: the name must end in .html or .gif", args.out.display())));
    }
    let file = pending(&args.out)?;
    let (title, recording) = match is_experiment(&args.input) {
        true => {
            let source = source(&args.input, &[])?;
            let experiment = experiment::experiment(&source)?;
            let run = experiment::run(&experiment, experiment.engine()?.as_mut(), |_| Control::Continue)?;
            // A failed run is animated too, with a warning.
            run.trouble(&experiment).iter().for_each(|trouble| say(&format!("warning: {trouble}")));
            (source.name, run.recording)
        }
        false => (args.input.display().to_string(), plot::recording(&args.input, options)?),
    };
    let name = Path::new(&title).file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let bytes = match kind {
        "html" => view::player(&name, &recording, args.speed).into_bytes(),
        _ => view::gif(&recording, args.speed).map_err(|reason| Failure::Data(format!("{}: {reason}", args.input.display())))?,
    };
    finish(file, &bytes)?;
    options.remark(&format!("{} records animated to {}", recording.len(), args.out.display()));
    Ok(ExitCode::SUCCESS)
}
