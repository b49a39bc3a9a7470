//! `sfers diagnose`: causes of model error from measured data.

mod all;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};

use super::output::{finish, pending, unwritable};
use super::{Failure, INTERRUPTED, Options, print, say};
use crate::diagnose::DiagnoseError;
use crate::diagnose::answer::{self, Answer};
use crate::diagnose::dataset::{DataError, Dataset};
use crate::diagnose::diagnosis::Verdict;
use crate::diagnose::identify::Identification;
use crate::files::{FolderLock, Locking};

/// Find from measured data what the simulation gets wrong, name the cause, and measure the gain on held-out runs.
///
/// Writes DIR/diagnosis.json, report.html, extended.toml (with drive.csv) and residuals.csv, and prints the verdict. Of a data set with [identify], which
/// fits constants to single numbers: identification.json, report.html and identified.toml.
///
/// With --all, of every data set in a folder, here or on a cluster: the results of each in a folder of its own in DIR, and a table, DIR/diagnoses.csv.
///
/// Example: sfers diagnose bench-7/dataset.toml --out diagnosis
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The description of the data, the folder of its dataset.toml, or preset:NAME.
    #[arg(required_unless_present = "all")]
    dataset: Option<PathBuf>,
    /// Diagnose every data set in this folder: its folders with a dataset.toml. What is done already is not done again.
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["dataset", "require"])]
    all: Option<PathBuf>,
    /// Folder of the results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of simulations at a time; by default one per processor. The results do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// End with code 1 unless causes are identified.
    #[arg(long)]
    require: bool,
    #[command(flatten)]
    cluster: super::submit::Args,
}

/// One data set with the folder of its results.
struct Task<'a> {
    dataset: &'a Path,
    out: &'a Path,
    /// Whether other causes than identified ones are a failure.
    require: bool,
    threads: usize,
}

impl From<DataError> for Failure {
    fn from(error: DataError) -> Self {
        match error {
            DataError::Description(error) => error.into(),
            other => Self::Data(other.to_string()),
        }
    }
}

impl From<DiagnoseError> for Failure {
    fn from(error: DiagnoseError) -> Self {
        Self::Simulation(error.to_string())
    }
}

/// The state of the command, for interrupts.
struct Work {
    /// The lock on the folder of the results.
    lock: Option<FolderLock>,
    /// True from the first written file on: the process then ends by itself within milliseconds.
    writing: bool,
}

static WORK: Mutex<Work> = Mutex::new(Work { lock: None, writing: false });

fn work() -> MutexGuard<'static, Work> {
    WORK.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Releases the lock and ends the process, unless results are being written.
fn interrupt() {
    let mut work = work();
    if !work.writing {
        work.lock = None;
        say("interrupted; nothing was written");
        std::process::exit(INTERRUPTED.into());
    }
}

/// Locks the folder of the results until the end of the process.
fn lock(folder: &Path) -> Result<(), Failure> {
    match FolderLock::take(folder).map_err(|error| unwritable(folder, &error))? {
        Locking::Locked(lock) => work().lock = Some(lock),
        Locking::Busy => {
            let reason = "another sfers diagnose is working on it; wait for it, or give every process a folder of its own";
            return Err(Failure::Usage(format!("{}: {reason}", folder.display())));
        }
        Locking::Unsupported => {
            let reason = "this file system cannot lock files: two processes must not write to it";
            say(&format!("warning: {}: {reason}", folder.display()));
        }
    }
    Ok(())
}

fn write(folder: &Path, name: &str, text: &str) -> Result<(), Failure> {
    finish(pending(&folder.join(name))?, text.as_bytes())
}

pub fn run(args: &Args, options: Options) -> Result<ExitCode, Failure> {
    let _ = ctrlc::set_handler(interrupt);
    let threads = args.cluster.jobs(args.jobs);
    if let Some(folder) = &args.all {
        return all::run(folder, args, threads, options);
    }
    let Some(dataset) = &args.dataset else { return Err(Failure::Usage("a data set or --all is needed".into())) };
    if args.cluster.shard.is_some() || args.cluster.shards.is_some() || args.cluster.submit.is_some() {
        return Err(Failure::Usage("--shard and --submit go with --all: one data set is one piece of work".into()));
    }
    one(&Task { dataset, out: &args.out, require: args.require, threads }, options)
}

/// Diagnoses one data set.
fn one(task: &Task, options: Options) -> Result<ExitCode, Failure> {
    let dataset = Dataset::read(task.dataset)?;
    std::fs::create_dir_all(task.out).map_err(|error| unwritable(task.out, &error))?;
    drop(pending(&task.out.join("diagnosis.json"))?);
    lock(task.out)?;
    let result = diagnose(task, options, &dataset);
    *work() = Work { lock: None, writing: false };
    result
}

/// Writes what was identified.
fn identified(task: &Task, options: Options, found: &Identification, page: &str, start: Instant) -> Result<ExitCode, Failure> {
    let json = serde_json::to_string_pretty(found).map_err(|error| unwritable(task.out, &error))?;
    let remarks: String = found.remarks.iter().map(|remark| format!("{remark}\n")).collect();
    let printed = print(&if options.json { format!("{json}\n") } else { format!("{}\n{remarks}", found.summary) });
    work().writing = true;
    write(task.out, "identified.toml", &found.file)?;
    write(task.out, "report.html", page)?;
    write(task.out, "identification.json", &format!("{json}\n"))?;
    options.remark(&format!("{:.0} s; the report is {}", start.elapsed().as_secs_f64(), task.out.join("report.html").display()));
    printed?;
    Ok(if task.require && !found.meets_all { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

fn diagnose(task: &Task, options: Options, dataset: &Dataset) -> Result<ExitCode, Failure> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(task.threads)
        .build()
        .map_err(|error| Failure::Usage(format!("--jobs {}: {error}", task.threads)))?;
    let bar = if options.quiet { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
    if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed} {msg}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(std::time::Duration::from_millis(200));
    let start = Instant::now();
    let progress = |stage: &str| bar.set_message(stage.to_owned());
    let command = format!("sfers diagnose {} --out {}", task.dataset.display(), task.out.display());
    let answer = pool.install(|| answer::answer(dataset, &command, &progress));
    bar.finish_and_clear();
    let (diagnosis, files, page) = match answer? {
        Answer::Diagnosed { diagnosis, files, page } => (diagnosis, files, page),
        Answer::Identified { identification, page } => return identified(task, options, &identification, &page, start),
    };
    let json = serde_json::to_string_pretty(&diagnosis).map_err(|error| unwritable(task.out, &error))?;
    let printed = if options.json {
        print(&format!("{json}\n"))
    } else {
        let mut text = format!("{}\n", diagnosis.summary);
        if let Some(next) = &diagnosis.next_experiment {
            text += &format!("To tell them apart: {next}.\n");
        }
        for line in &diagnosis.unexplained {
            text += &format!("What is left: {line}\n");
        }
        print(&text)
    };
    work().writing = true;
    if let Some(files) = files {
        write(task.out, "extended.toml", &files.experiment)?;
        write(task.out, "drive.csv", &files.drive)?;
        write(task.out, "residuals.csv", &files.residuals)?;
    }
    write(task.out, "report.html", &page)?;
    write(task.out, "diagnosis.json", &format!("{json}\n"))?;
    options.remark(&format!("{:.0} s; the report is {}", start.elapsed().as_secs_f64(), task.out.join("report.html").display()));
    printed?;
    let identified = matches!(diagnosis.verdict, Verdict::Named | Verdict::Tied);
    Ok(if task.require && !identified { ExitCode::from(1) } else { ExitCode::SUCCESS })
}
