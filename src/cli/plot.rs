//! `sfers plot`: figures of a recording or of a sweep's results.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::output::{finish, pending};
use super::{Failure, Options, print};
use crate::recording::{Recording, csv, npz};
use crate::view::{self, Kind, ResultsError};

/// Draw a recording or the results of a sweep as SVG.
///
/// Example: sfers plot jump.npz --kind traces --out jump.svg
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A recording, FILE.npz (this program's or the reference's) or FILE.csv (this program's), or a sweep's results.csv.
    input: PathBuf,
    /// The figure, FILE.svg; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// What of a recording is drawn.
    #[arg(long, value_enum, default_value = "shapes")]
    kind: Kind,
    /// Which measure of results is drawn; by default the first, with those of the same unit.
    #[arg(long, value_name = "NAME")]
    measure: Option<String>,
}

/// What a file's name ends in.
pub fn extension(path: &Path) -> &str {
    path.extension().and_then(|extension| extension.to_str()).unwrap_or("")
}

/// Reads a recording, FILE.npz or FILE.csv, with a word on what a CSV without its manifest leaves open.
pub fn recording(path: &Path, options: Options) -> Result<Recording, Failure> {
    let recording = if extension(path) == "csv" {
        let (recording, open) = csv::read_file(path)?;
        open.into_iter().for_each(|words| options.remark(&format!("warning: {words}")));
        recording
    } else {
        npz::read_file(path)?
    };
    if recording.is_empty() {
        return Err(Failure::Data(format!("{}: holds no records", path.display())));
    }
    Ok(recording)
}

pub fn run(args: &Args, options: Options) -> Result<ExitCode, Failure> {
    let to_stdout = args.out == Path::new("-");
    if !to_stdout && extension(&args.out) != "svg" {
        return Err(Failure::Usage(format!("{}: the name must end in .svg", args.out.display())));
    }
    let file = if to_stdout { None } else { Some(pending(&args.out)?) };
    let svg = match extension(&args.input) {
        "npz" => args.kind.figure(&recording(&args.input, options)?).svg(),
        "csv" if csv::is_recording(&args.input) => args.kind.figure(&recording(&args.input, options)?).svg(),
        "csv" => {
            let data = |reason: String| Failure::Data(format!("{}: {reason}", args.input.display()));
            let text = crate::files::read_text(&args.input).map_err(|error| data(error.to_string()))?;
            view::results(&text, args.measure.as_deref()).map_err(|error| match error {
                ResultsError::Table(reason) => data(reason),
                ResultsError::Choice(reason) => Failure::Usage(format!("{}: {reason}", args.input.display())),
            })?
        }
        _ => return Err(Failure::Usage(format!("{}: the name must end in .npz or .csv", args.input.display()))),
    };
    match file {
        Some(file) => {
            finish(file, svg.as_bytes())?;
            options.remark(&format!("drawn to {}", args.out.display()));
        }
        None => print(&svg)?,
    }
    Ok(ExitCode::SUCCESS)
}
