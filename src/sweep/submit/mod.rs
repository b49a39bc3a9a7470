//! Job scripts for schedulers: an array of shards, and a job after it that computes what they left and collects the results.
//!
//! The scripts call this program as a person would. Nothing is needed on the cluster but the scheduler and a folder that all its machines see.

mod hyperqueue;
mod slurm;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::rows::{RowError, io};
use crate::date;
use crate::files::{self, Pending};

/// A scheduler that jobs can be submitted to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Scheduler {
    /// Slurm, by sbatch.
    Slurm,
    /// HyperQueue, by hq.
    Hq,
}

/// What is to be run on a cluster.
#[derive(Debug, Clone)]
pub struct Job {
    /// Name for the scheduler.
    pub name: String,
    /// Folder of the results, for scripts and logs.
    pub folder: PathBuf,
    /// Working directory of the commands.
    pub working_directory: PathBuf,
    /// The program.
    pub program: PathBuf,
    /// Its arguments; `--shard K/N` and `--jobs` are added for the shards, `--jobs` for the job after them.
    pub arguments: Vec<String>,
    /// Number of shards.
    pub shards: usize,
    /// The shards that are submitted, sorted; the others are done.
    pub tasks: Vec<usize>,
    /// Threads of one shard.
    pub threads: u16,
    /// Time limit of a job, as the scheduler writes it, or its default.
    pub time: Option<String>,
    /// Partition, or the scheduler's default.
    pub partition: Option<String>,
    /// Further arguments for the scheduler.
    pub scheduler_arguments: Vec<String>,
}

/// Scripts and commands that submit a job.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Names and texts of the scripts.
    pub scripts: Vec<(&'static str, String)>,
    /// The commands, in order, as a shell takes them.
    pub commands: Vec<String>,
}

/// What was submitted, in `submission.json`.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
pub struct Submission {
    /// Of this file.
    pub schema: u32,
    /// The scheduler.
    pub scheduler: Scheduler,
    /// The scheduler's numbers of the jobs, the last that of the one after the shards.
    pub jobs: Vec<String>,
    /// Number of shards.
    pub shards: usize,
    /// When, UTC.
    pub submitted: String,
    /// The commands.
    pub commands: Vec<String>,
}

/// A job that cannot be submitted, asked after or cancelled.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SubmitError {
    /// A program of the scheduler cannot be started.
    #[error(
        "{program} cannot be started ({reason}): this machine has no {scheduler:?}, or its commands are not on the PATH; {advice}"
    )]
    NoProgram {
        /// The program.
        program: String,
        /// Why.
        reason: String,
        /// The scheduler.
        scheduler: Scheduler,
        /// What to do.
        advice: &'static str,
    },
    /// The scheduler refused.
    #[error("{command}: {answer}; {consequence}")]
    Refused {
        /// The command.
        command: String,
        /// What it printed.
        answer: String,
        /// What follows and what to do.
        consequence: String,
    },
    /// A path that cannot stand in a job script.
    #[error("{what} {text:?} cannot stand in a job script: {reason}")]
    Unusable {
        /// What it is.
        what: &'static str,
        /// It.
        text: String,
        /// Why.
        reason: &'static str,
    },
    /// A file of the submission.
    #[error(transparent)]
    File(#[from] RowError),
}

/// Name of the script of the shards.
pub(super) const SHARDS: &str = "shards.sh";
/// Name of the script of the job after them.
pub(super) const FINISH: &str = "finish.sh";
const SUBMISSION: &str = "submission.json";

/// The scripts in a folder, for the manifest.
pub(super) fn scripts(folder: &Path) -> serde_json::Value {
    let text = |name: &str| files::read_text(&folder.join(name)).ok();
    serde_json::json!({ SHARDS: text(SHARDS), FINISH: text(FINISH) })
}

impl Scheduler {
    /// Scripts and commands of a job.
    ///
    /// # Errors
    /// [`SubmitError::Unusable`] for a name that a script cannot hold.
    pub fn plan(self, job: &Job) -> Result<Plan, SubmitError> {
        job.check()?;
        Ok(match self {
            Self::Slurm => slurm::plan(job, slurm::largest_index()),
            Self::Hq => hyperqueue::plan(job),
        })
    }

    /// Submits a job whose scripts are written.
    ///
    /// # Errors
    /// [`SubmitError`] if the scheduler is not there or refuses; what it took before is cancelled.
    pub fn submit(self, job: &Job, plan: &Plan) -> Result<Submission, SubmitError> {
        let jobs = match self {
            Self::Slurm => slurm::submit(job)?,
            Self::Hq => hyperqueue::submit(job)?,
        };
        let submission = Submission {
            schema: 1,
            scheduler: self,
            jobs,
            shards: job.shards,
            submitted: date::now().iso(),
            commands: plan.commands.clone(),
        };
        write(&job.folder.join(SUBMISSION), &format!("{:#}\n", serde_json::json!(submission)))?;
        Ok(submission)
    }
}

impl Submission {
    /// Reads the submission of a folder; `None` if there was none.
    ///
    /// # Errors
    /// [`RowError`] if the file cannot be read or is none.
    pub fn read(folder: &Path) -> Result<Option<Self>, RowError> {
        let path = folder.join(SUBMISSION);
        match files::read_text(&path) {
            Ok(text) => serde_json::from_str(&text)
                .map(Some)
                .map_err(|error| RowError::Foreign { path, reason: format!("is not a submission ({error}); remove it") }),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(io(&path)(error)),
        }
    }

    /// The states of its tasks that the scheduler still has, with their numbers; empty if all have ended.
    ///
    /// # Errors
    /// [`SubmitError`] if the scheduler is not there.
    pub fn queue(&self) -> Result<Vec<(String, usize)>, SubmitError> {
        let states = match self.scheduler {
            Scheduler::Slurm => slurm::states(&self.jobs)?,
            Scheduler::Hq => hyperqueue::states(&self.jobs)?,
        };
        let mut counts: Vec<(String, usize)> = Vec::new();
        for state in states {
            match counts.iter_mut().find(|(other, _)| *other == state) {
                Some((_, count)) => *count += 1,
                None => counts.push((state, 1)),
            }
        }
        Ok(counts)
    }

    /// Cancels what has not ended.
    ///
    /// # Errors
    /// [`SubmitError`] if the scheduler is not there or refuses.
    pub fn cancel(&self) -> Result<(), SubmitError> {
        match self.scheduler {
            Scheduler::Slurm => slurm::cancel(&self.jobs),
            Scheduler::Hq => hyperqueue::cancel(&self.jobs),
        }
    }
}

const UNUSABLE: &str = "it has a quotation mark, a backslash or a line end, or is not UTF-8";

impl Job {
    fn check(&self) -> Result<(), SubmitError> {
        let paths =
            [("the folder", &self.folder), ("the working directory", &self.working_directory), ("the program", &self.program)];
        for (what, path) in paths {
            let text = path.display().to_string();
            if path.to_str().is_none_or(|text| text.contains(['\n', '"', '\\'])) {
                return Err(SubmitError::Unusable { what, text, reason: UNUSABLE });
            }
        }
        let mut further = self.scheduler_arguments.iter().chain(&self.partition).chain(&self.time).chain([&self.name]);
        match further.find(|text| text.contains(['\n', '"', '\\'])) {
            Some(text) => Err(SubmitError::Unusable { what: "the option", text: text.clone(), reason: UNUSABLE }),
            None => Ok(()),
        }
    }

    /// Writes the scripts.
    ///
    /// # Errors
    /// [`RowError::Io`].
    pub fn write(&self, plan: &Plan) -> Result<(), RowError> {
        for (name, text) in &plan.scripts {
            let path = self.folder.join(name);
            write(&path, text)?;
            make_executable(&path).map_err(io(&path))?;
        }
        Ok(())
    }

    /// The path of a script.
    fn script(&self, name: &str) -> String {
        self.folder.join(name).display().to_string()
    }

    /// The end of a script: where to work and what to run, with `more` arguments.
    fn command(&self, more: &str) -> String {
        let arguments: Vec<String> = self.arguments.iter().map(|argument| quoted(argument)).collect();
        format!(
            "sfers={program}\n\
             if [ ! -x \"$sfers\" ]; then\n  \
             echo \"$(hostname): $sfers is not there or not executable: put it where all machines see it, and submit again\" >&2\n  \
             exit 127\n\
             fi\n\
             cd {directory}\n\
             exec \"$sfers\" {arguments} --jobs {threads}{more}\n",
            program = quoted(&self.program.display().to_string()),
            directory = quoted(&self.working_directory.display().to_string()),
            arguments = arguments.join(" "),
            threads = self.threads,
        )
    }

    /// The end of the script of a shard, whose number the shell expression `number` gives.
    fn shard_command(&self, number: &str) -> String {
        self.command(&format!(" --quiet --shard \"{number}/{}\"", self.shards))
    }

    /// The end of the script after the shards, which removes the empty logs `logs` before.
    fn finish_command(&self, logs: &str) -> String {
        let folder = quoted(&self.folder.display().to_string());
        format!("find {folder} -maxdepth 1 -name '{logs}' -empty -delete\n{}", self.command(""))
    }
}

fn write(path: &Path, text: &str) -> Result<(), RowError> {
    Pending::open(path).and_then(|pending| pending.finish(text.as_bytes())).map_err(io(path))
}

#[cfg(unix)]
fn make_executable(path: &Path) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    let mut mode = std::fs::metadata(path)?.permissions();
    // Whoever may read it may run it.
    mode.set_mode(mode.mode() | (mode.mode() & 0o444) >> 2);
    std::fs::set_permissions(path, mode)
}

#[cfg(not(unix))]
fn make_executable(_: &Path) -> std::io::Result<()> {
    Ok(())
}

/// Options as lines at the top of a script, `mark` before each; a value with blanks in quotation marks.
fn directives(mark: &str, options: &[String]) -> String {
    let line = |option: &String| match option.split_once('=') {
        Some((key, value)) if value.contains(char::is_whitespace) => format!("{mark} {key}=\"{value}\"\n"),
        _ => format!("{mark} {option}\n"),
    };
    options.iter().map(line).collect()
}

/// A text as one word of a shell.
fn quoted(text: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_./=:,+@%".contains(&byte);
    if !text.is_empty() && text.bytes().all(is_plain) { text.to_owned() } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

/// A command line as a shell takes it.
fn shown(program: &str, arguments: &[String]) -> String {
    let words = arguments.iter().map(|argument| quoted(argument));
    std::iter::once(program.to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// Sorted numbers as ranges: `1-3,7,9-10`.
fn ranges(numbers: &[usize]) -> String {
    let mut text = String::new();
    for run in numbers.chunk_by(|a, b| a + 1 == *b) {
        let comma = if text.is_empty() { "" } else { "," };
        let _ = match run {
            [one] => write!(text, "{comma}{one}"),
            _ => write!(text, "{comma}{}-{}", run[0], run[run.len() - 1]),
        };
    }
    text
}

/// Runs a program of the scheduler; returns what it printed.
fn call(scheduler: Scheduler, program: &str, arguments: &[String], consequence: &str) -> Result<String, SubmitError> {
    let output = Command::new(program).args(arguments).stdin(std::process::Stdio::null()).output();
    let output = output.map_err(|error| SubmitError::NoProgram {
        program: program.into(),
        reason: error.to_string(),
        scheduler,
        advice: "run the printed commands where it has",
    })?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let answer = String::from_utf8_lossy(&output.stderr);
    let answer = answer.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ");
    Err(SubmitError::Refused { command: shown(program, arguments), answer, consequence: consequence.into() })
}

#[cfg(test)]
mod tests;
