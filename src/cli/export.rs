//! `sfers urdf` and `sfers mjcf`: the robot for other simulators.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::output::{finish, pending};
use super::run::source;
use super::{Failure, Options, print};
use crate::experiment;
use crate::export;
use crate::files::with_suffix;

/// Output format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    Urdf,
    Mjcf,
}

/// Arguments of both commands.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The experiment file, `-` for standard input, or preset:NAME (or NAME where there is no such file) for a built-in one.
    experiment: PathBuf,
    /// Override a key, for example robot.actuators=3. May be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<String>,
    /// Where to write; `-` is standard output. Beside FILE.urdf stands FILE.urdf.json, with what URDF cannot say.
    #[arg(long, value_name = "FILE", default_value = "-")]
    out: PathBuf,
}

/// The command without folders, for the comment in the file.
fn command(format: Format, args: &Args) -> String {
    let name = |path: &Path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let settings: String = args.settings.iter().map(|setting| format!(" --set {setting}")).collect();
    let format = if format == Format::Urdf { "urdf" } else { "mjcf" };
    format!("sfers {format} {}{settings}", name(&args.experiment))
}

pub fn run(format: Format, args: &Args, options: Options) -> Result<ExitCode, Failure> {
    let experiment = experiment::experiment(&source(&args.experiment, &args.settings)?)?;
    experiment.robot.check().map_err(|error| Failure::Usage(error.to_string()))?;
    let command = command(format, args);
    let text = match format {
        Format::Urdf => export::urdf(&experiment, &command),
        Format::Mjcf => export::mjcf(&experiment, &command),
    };
    if args.out == Path::new("-") {
        print(&text)?;
        return Ok(ExitCode::SUCCESS);
    }
    let file = pending(&args.out)?;
    if format == Format::Urdf && !file.is_stream() {
        let beside = pending(&with_suffix(&args.out, ".json"))?;
        finish(beside, format!("{:#}\n", export::sidecar(&experiment, &command)).as_bytes())?;
    }
    finish(file, text.as_bytes())?;
    options.remark(&format!("written to {}", args.out.display()));
    Ok(ExitCode::SUCCESS)
}
