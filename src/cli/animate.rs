//! `sfers animate`: a recording as a page that plays it, or as a GIF.

use std::path::PathBuf;
use std::process::ExitCode;

use super::output::{finish, pending};
use super::plot::extension;
use super::{Failure, Options};
use crate::experiment::{self, Control, Source};
use crate::recording::npz;
use crate::view;

/// Animate a recording: FILE.html plays, scrubs and shows voltages; FILE.gif is a film.
///
/// Example: sfers animate jump.npz --out jump.html
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A recording FILE.npz, this program's or the reference's; or an experiment FILE.toml, which is run first.
    input: PathBuf,
    /// FILE.html or FILE.gif.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Speed to begin with (1: real time); by default one that takes some seconds.
    #[arg(long, value_name = "X", value_parser = speed)]
    speed: Option<f64>,
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
    let recording = match extension(&args.input) {
        "toml" => {
            let experiment = experiment::experiment(&Source::from_file(&args.input)?)?;
            let run = experiment::run(&experiment, experiment.engine()?.as_mut(), |_| Control::Continue)?;
            // A film of a run that went wrong is worth seeing, but not without a word.
            run.trouble(&experiment).iter().for_each(|trouble| eprintln!("warning: {trouble}"));
            run.recording
        }
        _ => npz::read_file(&args.input)?,
    };
    if recording.is_empty() {
        return Err(Failure::Data(format!("{}: holds no records", args.input.display())));
    }
    let name = args.input.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let bytes = match kind {
        "html" => view::player(&name, &recording, args.speed).into_bytes(),
        _ => view::gif(&recording, args.speed).map_err(|reason| Failure::Data(format!("{}: {reason}", args.input.display())))?,
    };
    finish(file, &bytes)?;
    options.remark(&format!("{} records animated to {}", recording.len(), args.out.display()));
    Ok(ExitCode::SUCCESS)
}
