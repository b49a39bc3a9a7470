//! `sfers plot`: figures of a recording or of a sweep's results.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::output::{finish, pending};
use super::{Failure, Options, print, say};
use crate::recording::{Recording, csv, npz};
use crate::view::{self, Figure, ImageError, Kind, ResultsError, Size, View};

/// Draw a recording or the results of a sweep as SVG, PDF or PNG, in the size of a journal's column.
///
/// Example: sfers plot jump.npz --kind traces --out jump.pdf
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A recording, FILE.npz (this program's or the reference's) or FILE.csv (this program's), or a sweep's results.csv.
    input: PathBuf,
    /// The figure, FILE.svg, FILE.pdf or FILE.png; `-` is SVG on standard output.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Kind of figure of a recording.
    #[arg(long, value_enum, default_value = "shapes")]
    kind: Kind,
    /// Measure of results; by default the first, with those of the same unit.
    #[arg(long, value_name = "NAME")]
    measure: Option<String>,
    /// Draw only rows of results with this value of a varied key, such as --where friction.low=1.
    #[arg(long = "where", value_name = "KEY=VALUE", value_parser = pair)]
    only: Vec<(String, String)>,
    /// Draw a panel for each value of this varied key; by default results over three and more keys choose those with the fewest values.
    #[arg(long, value_name = "KEY")]
    by: Vec<String>,
    /// Size on paper: one column of a journal (85 mm, text of 8 pt), two columns (175 mm, 8 pt), or a page on a screen (170 mm, 9.5 pt).
    #[arg(long, value_enum, default_value = "single")]
    size: Format,
    /// Another width (mm).
    #[arg(long, value_name = "X", value_parser = within(40.0, 1000.0))]
    width_mm: Option<f64>,
    /// Resolution of a PNG (dots per inch).
    #[arg(long, value_name = "N", value_parser = within(30.0, 1200.0), default_value = "300")]
    dpi: f64,
}

/// Sizes by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    Single,
    Double,
    Screen,
}

fn pair(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("must be KEY=VALUE")?;
    Ok((key.trim().into(), value.trim().into()))
}

fn within(low: f64, high: f64) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        let number = text.parse().ok().filter(|value| (low..=high).contains(value));
        number.ok_or_else(|| format!("must be a number from {low} to {high}"))
    }
}

/// The extension of a path; empty without one.
pub fn extension(path: &Path) -> &str {
    path.extension().and_then(|extension| extension.to_str()).unwrap_or("")
}

/// Reads a recording, FILE.npz or FILE.csv; warns of a CSV without its manifest.
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

/// The name of a file without its extension; for `results.csv` of a sweep that of its folder.
pub fn name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default();
    let folder = path.parent().and_then(Path::file_name).filter(|_| stem == "results");
    folder.unwrap_or(stem).to_string_lossy().into_owned()
}

fn figure(args: &Args, options: Options) -> Result<Figure, Failure> {
    let of_results = args.measure.is_some() || !args.only.is_empty() || !args.by.is_empty();
    match extension(&args.input) {
        "npz" | "csv" if extension(&args.input) == "npz" || csv::is_recording(&args.input) => {
            if of_results {
                let reason = "--measure, --where and --by choose from results of a sweep, and this is a recording";
                return Err(Failure::Usage(format!("{}: {reason}", args.input.display())));
            }
            let recording = recording(&args.input, options)?;
            if let (Kind::Spectrum, Some(problem)) = (args.kind, view::aliased(&recording)) {
                // Also with --quiet: the figure does not show the motion.
                say(&format!("warning: {problem}"));
            }
            Ok(args.kind.titled(&name(&args.input), &recording))
        }
        "csv" => {
            let data = |reason: String| Failure::Data(format!("{}: {reason}", args.input.display()));
            let text = crate::files::read_text(&args.input).map_err(|error| data(error.to_string()))?;
            let view =
                View { name: name(&args.input), measure: args.measure.clone(), only: args.only.clone(), by: args.by.clone() };
            view::figure_of_results(&text, &view).map_err(|error| match error {
                ResultsError::Table(reason) => data(reason),
                ResultsError::Choice(reason) => Failure::Usage(format!("{}: {reason}", args.input.display())),
            })
        }
        _ => Err(Failure::Usage(format!("{}: the name must end in .npz or .csv", args.input.display()))),
    }
}

pub fn run(args: &Args, options: Options) -> Result<ExitCode, Failure> {
    let to_stdout = args.out == Path::new("-");
    let kind = if to_stdout { "svg" } else { extension(&args.out) };
    if !["svg", "pdf", "png"].contains(&kind) {
        return Err(Failure::Usage(format!("{}: the name must end in .svg, .pdf or .png", args.out.display())));
    }
    let file = if to_stdout { None } else { Some(pending(&args.out)?) };
    let mut size = match args.size {
        Format::Single => Size::SINGLE,
        Format::Double => Size::DOUBLE,
        Format::Screen => Size::SCREEN,
    };
    size.width_mm = args.width_mm.unwrap_or(size.width_mm);
    let svg = figure(args, options)?.size(size).svg();
    let failed = |error: ImageError| Failure::Data(format!("{}: {error}", args.input.display()));
    let bytes = match kind {
        "pdf" => view::pdf(&svg).map_err(failed)?,
        "png" => view::png(&svg, args.dpi).map_err(failed)?,
        _ => svg.clone().into_bytes(),
    };
    match file {
        Some(file) => {
            finish(file, &bytes)?;
            options.remark(&format!("drawn to {}", args.out.display()));
        }
        None => print(&svg)?,
    }
    Ok(ExitCode::SUCCESS)
}
