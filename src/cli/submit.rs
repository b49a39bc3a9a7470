//! `--submit`: job scripts for a cluster, written, shown and handed to its scheduler.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use serde_json::{Value, json};

use super::output::unwritable;
use super::{Failure, Options, print, say};
use crate::sweep::Shard;
use crate::sweep::submit::{Job, Plan, Scheduler, Submission, SubmitError};

/// Options of `--submit`.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "On a cluster")]
#[group(skip)] // its name would be that of the command's own arguments
pub struct Args {
    /// Compute only every N-th point or data set, beginning with the K-th, and leave the others to other machines; `auto` in a job array of Slurm, PBS, SGE, LSF,
    /// Kubernetes or HyperQueue.
    #[arg(long, value_name = "K/N|auto")]
    pub shard: Option<ShardChoice>,
    /// Compute nothing here: write job scripts for this scheduler into DIR and print the commands that submit them.
    #[arg(long, value_name = "SCHEDULER", conflicts_with = "shard")]
    pub submit: Option<Scheduler>,
    /// Number of shards, with --submit or --shard auto; by default of --submit so many that each takes about ten minutes.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub shards: Option<u32>,
    /// Time limit of a job, in the scheduler's own form.
    #[arg(long, requires = "submit")]
    pub time: Option<String>,
    /// Partition of the jobs, for Slurm.
    #[arg(long, requires = "submit")]
    pub partition: Option<String>,
    /// A further option for sbatch or hq submit, as --sbatch-arg=--account=robots. May be repeated.
    #[arg(long, visible_alias = "hq-arg", value_name = "OPTION", requires = "submit", allow_hyphen_values = true)]
    pub sbatch_arg: Vec<String>,
    /// Submit the jobs.
    #[arg(long, requires = "submit")]
    pub yes: bool,
    /// Write nothing: print the scripts and the commands.
    #[arg(long, requires = "submit", conflicts_with = "yes")]
    pub dry_run: bool,
}

/// `--shard`.
#[derive(Debug, Clone, Copy)]
pub enum ShardChoice {
    /// K/N.
    Given(Shard),
    /// The scheduler says.
    Auto,
}

impl std::str::FromStr for ShardChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" { Ok(Self::Auto) } else { text.parse().map(Self::Given) }
    }
}

impl Args {
    /// Number of threads: those of the machine, in a job array one.
    pub fn jobs(&self, given: Option<u16>) -> usize {
        let of_machine = || std::thread::available_parallelism().map_or(1, Into::into);
        match (given, self.shard) {
            (Some(jobs), _) => jobs.into(),
            (None, Some(ShardChoice::Auto)) => 1,
            (None, _) => of_machine(),
        }
    }

    /// The shard of this process.
    pub fn shard(&self) -> Result<Shard, Failure> {
        let count = self.shards.map(|count| count as usize);
        match (self.shard, count) {
            (Some(ShardChoice::Auto), count) => Shard::from_environment(count, &|name| std::env::var(name).ok())
                .map_err(|reason| Failure::Usage(format!("--shard auto: {reason}"))),
            (_, Some(_)) => Err(Failure::Usage("--shards goes with --submit or with --shard auto".into())),
            (Some(ShardChoice::Given(shard)), None) => Ok(shard),
            (None, None) => Ok(Shard::ALL),
        }
    }
}

/// Time that a shard should take (s).
const SHARD_S: f64 = 600.0;
/// Largest number of shards that is chosen without `--shards`.
const MOST_SHARDS: usize = 1000;
/// A job may take so many times as long as was estimated, and at least ten minutes: the machines of a cluster differ, and so do the points.
const MARGIN: f64 = 4.0;

impl From<SubmitError> for Failure {
    fn from(error: SubmitError) -> Self {
        match error {
            SubmitError::File(error) => error.into(),
            error => Self::Usage(error.to_string()),
        }
    }
}

/// What a command wants to have computed.
pub struct Work {
    /// Name for the scheduler.
    pub name: String,
    /// Folder of the results.
    pub folder: PathBuf,
    /// The command's arguments.
    pub arguments: Vec<String>,
    /// Number of pieces of work in all.
    pub pieces: usize,
    /// Those that are not done, sorted.
    pub missing: Vec<usize>,
    /// Time of one piece on one thread (s), if it was measured.
    pub piece_s: Option<f64>,
    /// Threads of one job.
    pub threads: u16,
}

impl Work {
    /// The job, divided among as many shards as `args` or an earlier submission say, or as the measured time asks for.
    fn job(self, args: &Args, scheduler: Scheduler, earlier: Option<usize>) -> Result<Job, Failure> {
        let total_s = self.piece_s.map(|piece_s| piece_s * self.missing.len() as f64 / f64::from(self.threads));
        let chosen = total_s.map_or(MOST_SHARDS, |total_s| (total_s / SHARD_S).ceil() as usize).clamp(1, MOST_SHARDS);
        let shards = args.shards.map(|shards| shards as usize).or(earlier).unwrap_or(chosen).min(self.pieces);
        let mut tasks: Vec<usize> = self.missing.iter().map(|&index| Shard::number_of(index, shards)).collect();
        tasks.sort_unstable();
        tasks.dedup();
        let limit = |total_s: f64| (MARGIN * total_s / tasks.len() as f64 / 60.0).ceil().max(10.0).to_string();
        let time = args.time.clone().or_else(|| total_s.filter(|_| scheduler == Scheduler::Slurm).map(limit));
        let program = std::env::current_exe().map_err(|error| Failure::Usage(format!("the path of this program: {error}")))?;
        let working_directory =
            std::env::current_dir().map_err(|error| Failure::Usage(format!("the working directory: {error}")))?;
        Ok(Job {
            name: self.name,
            folder: self.folder,
            working_directory,
            program,
            arguments: self.arguments,
            shards,
            tasks,
            threads: self.threads,
            time,
            partition: args.partition.clone(),
            scheduler_arguments: args.sbatch_arg.clone(),
        })
    }
}

/// The path from the root, without resolving links.
pub fn absolute(path: &Path) -> Result<PathBuf, Failure> {
    std::path::absolute(path).map_err(|error| unwritable(path, &error))
}

/// An earlier submission of a folder, if its jobs have ended.
///
/// # Errors
/// If they have not.
pub fn ended(folder: &Path) -> Result<Option<Submission>, Failure> {
    let Some(submission) = Submission::read(folder)? else { return Ok(None) };
    match submission.queue() {
        Ok(states) if states.is_empty() => {}
        Ok(states) => {
            let reason = "are still with the scheduler; wait for them, or end them with --cancel";
            return Err(Failure::Usage(format!(
                "{}: jobs {} {reason} ({})",
                folder.display(),
                submission.jobs.join(", "),
                counts(&states)
            )));
        }
        Err(error) => say(&format!("warning: whether the jobs of an earlier submission have ended cannot be asked: {error}")),
    }
    Ok(Some(submission))
}

/// States with their numbers, in words.
pub fn counts(states: &[(String, usize)]) -> String {
    states.iter().map(|(state, count)| format!("{count} {state}")).collect::<Vec<_>>().join(", ")
}

/// Writes the scripts of a work, shows the commands, and submits if that is wanted. `claim` makes the folder that of the work.
pub fn submit(
    work: Work,
    args: &Args,
    scheduler: Scheduler,
    earlier: Option<usize>,
    claim: impl FnOnce() -> Result<(), Failure>,
    options: Options,
) -> Result<ExitCode, Failure> {
    let (pieces, missing, piece_s) = (work.pieces, work.missing.len(), work.piece_s);
    let job = work.job(args, scheduler, earlier)?;
    let plan = scheduler.plan(&job)?;
    let mut submission = None;
    if !args.dry_run {
        claim()?;
        job.write(&plan)?;
        if args.yes {
            submission = Some(scheduler.submit(&job, &plan)?);
        }
    }
    if options.json {
        let object = json!({
            "schema": 1, "pieces": pieces, "missing": missing, "piece_s": piece_s, "shards": job.shards, "tasks": job.tasks.len(),
            "scripts": plan.scripts.iter().map(|(name, text)| json!({ "name": name, "text": text })).collect::<Value>(),
            "commands": plan.commands, "submitted": submission,
        });
        print(&format!("{object}\n"))?;
        return Ok(ExitCode::SUCCESS);
    }
    print(&text(&job, &plan, args, submission.as_ref()))?;
    Ok(ExitCode::SUCCESS)
}

/// What the command prints.
fn text(job: &Job, plan: &Plan, args: &Args, submission: Option<&Submission>) -> String {
    let mut text = String::new();
    if args.dry_run {
        for (name, script) in &plan.scripts {
            text += &format!("# {}\n{script}\n", job.folder.join(name).display());
        }
    }
    text += &plan.commands.iter().map(|command| format!("{command}\n")).collect::<String>();
    match submission {
        Some(submission) => text += &format!("submitted: jobs {}\n", submission.jobs.join(", ")),
        None if args.dry_run => {}
        None => {
            text += "# not submitted: run these commands with the numbers of the jobs for JOB1, JOB2, or the same command with --yes\n"
        }
    }
    text
}
