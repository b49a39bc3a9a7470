//! The command line: one file per subcommand, no physics.

mod animate;
mod crosscheck;
mod diagnose;
mod effects;
mod export;
mod help;
mod man;
mod output;
mod plot;
mod presets;
#[cfg(feature = "bullet")]
mod reproduce;
mod run;
mod submit;
mod sweep;

use std::io::{self, Write};
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use crate::crosscheck::CrosscheckError;
use crate::engine::EngineError;
use crate::experiment::ConfigError;
use crate::recording::RecordingError;

/// Exit code of a run that was interrupted from the keyboard: 128 + SIGINT, as in shells.
const INTERRUPTED: u8 = 130;

/// Simulate planar piezoelectric soft robots on Bullet, bit for bit as the published PyBullet simulator does.
#[derive(Debug, Parser)]
#[command(name = "sfers", version = VERSION, disable_help_subcommand = true)]
struct Cli {
    /// No progress and no remarks; errors and results only.
    #[arg(long, short, global = true)]
    quiet: bool,
    /// The result as one JSON object on standard output.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(run::Args),
    Sweep(sweep::Args),
    Plot(plot::Args),
    /// Write the robot as URDF.
    ///
    /// Example: sfers preset cantilever-dc | sfers urdf - --out cantilever.urdf
    Urdf(export::Args),
    /// Write the robot, with springs, dampers, actuators and floor, as MJCF for MuJoCo.
    ///
    /// Example: sfers preset jump-14hz | sfers mjcf - --out robot.xml
    Mjcf(export::Args),
    Animate(animate::Args),
    Crosscheck(crosscheck::Args),
    #[cfg(feature = "bullet")]
    Reproduce(reproduce::Args),
    Diagnose(diagnose::Args),
    /// List the extensions of the model with their parameters.
    ///
    /// Example: sfers effects --json
    Effects,
    /// List the built-in experiments.
    Presets,
    /// Print a built-in experiment, to start from.
    ///
    /// Example: sfers preset jump-14hz > jump.toml
    Preset {
        /// Its name, from `sfers presets`.
        name: String,
    },
    Help(help::Args),
    Man(man::Args),
    /// Print a completion script for a shell.
    ///
    /// Example: sfers completions bash > /etc/bash_completion.d/sfers
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

const VERSION: &str =
    concat!(env!("CARGO_PKG_VERSION"), " (Bullet ", env!("SFERS_BULLET"), ", revision ", env!("SFERS_GIT_REVISION"), ")");

/// What all subcommands need to know.
#[derive(Debug, Clone, Copy)]
struct Options {
    quiet: bool,
    json: bool,
}

impl Options {
    /// A remark on stderr, unless the user wants none.
    fn remark(self, text: &str) {
        if !self.quiet {
            say(text);
        }
    }
}

/// How a command can fail, by exit code.
#[derive(Debug)]
enum Failure {
    /// 2: usage, config, or an output that cannot be written.
    Usage(String),
    /// 3: input data unreadable or invalid.
    Data(String),
    /// 4: the simulation failed.
    Simulation(String),
    /// Standard output was closed by its reader: the end, quietly.
    ClosedPipe,
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Self {
        match error {
            ConfigError::Data { .. } => Self::Data(error.to_string()),
            _ => Self::Usage(error.to_string()),
        }
    }
}

impl From<EngineError> for Failure {
    fn from(error: EngineError) -> Self {
        match error {
            EngineError::Model(_) | EngineError::NoBullet => Self::Usage(error.to_string()),
            _ => Self::Simulation(error.to_string()),
        }
    }
}

impl From<RecordingError> for Failure {
    fn from(error: RecordingError) -> Self {
        match error {
            RecordingError::Unreadable { .. } => Self::Data(error.to_string()),
            RecordingError::Unwritable { .. } => Self::Usage(error.to_string()),
        }
    }
}

impl From<CrosscheckError> for Failure {
    fn from(error: CrosscheckError) -> Self {
        match error {
            CrosscheckError::NoPython { .. } | CrosscheckError::NoClass(_) | CrosscheckError::Temporary(_) => {
                Self::Usage(error.to_string())
            }
            _ => Self::Data(error.to_string()),
        }
    }
}

impl From<io::Error> for Failure {
    /// Only for writing to standard output; files have their names added where they are opened.
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Self::ClosedPipe,
            _ => Self::Usage(format!("standard output: {error}")),
        }
    }
}

/// Writes a line to standard error. `eprintln!` would panic where it cannot be written.
fn say(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Writes to standard output. `println!` would panic when the reader has gone.
fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}

/// Parses the command line, runs the command and prints an error once.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // Help goes to stdout with code 0, errors to stderr with code 2. A closed pipe is no reason to complain.
            let code = match error.print() {
                Err(failure) if failure.kind() != io::ErrorKind::BrokenPipe => 2,
                _ => u8::try_from(error.exit_code()).unwrap_or(2),
            };
            return ExitCode::from(code);
        }
    };
    let options = Options { quiet: cli.quiet, json: cli.json };
    let result = match cli.command {
        Command::Run(args) => run::run(&args, options),
        Command::Sweep(args) => sweep::run(&args, options),
        Command::Urdf(args) => export::run(export::Format::Urdf, &args, options),
        Command::Mjcf(args) => export::run(export::Format::Mjcf, &args, options),
        Command::Plot(args) => plot::run(&args, options),
        Command::Animate(args) => animate::run(&args, options),
        #[cfg(feature = "bullet")]
        Command::Reproduce(args) => reproduce::run(&args, options),
        Command::Crosscheck(args) => crosscheck::run(&args, options),
        Command::Diagnose(args) => diagnose::run(&args, options),
        Command::Effects => effects::run(options),
        Command::Presets => presets::list(options),
        Command::Preset { name } => presets::show(&name),
        Command::Help(args) => help::run(&args, options),
        Command::Man(args) => man::run(&args, options),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "sfers", &mut script);
            print(&String::from_utf8_lossy(&script)).map(|()| ExitCode::SUCCESS)
        }
    };
    let (code, message) = match result {
        Ok(code) => return code,
        Err(Failure::ClosedPipe) => return ExitCode::SUCCESS,
        Err(Failure::Usage(message)) => (2, message),
        Err(Failure::Data(message)) => (3, message),
        Err(Failure::Simulation(message)) => (4, message),
    };
    say(&format!("error: {message}"));
    ExitCode::from(code)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
    }
}
