//! `sfers diagnose`: causes of model error from measured data.

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
/// Example: sfers diagnose bench-7/dataset.toml --out diagnosis
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The description of the data, the folder of its dataset.toml, or preset:NAME.
    dataset: PathBuf,
    /// Folder of the results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of simulations at a time; by default one per processor. The results do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// End with code 1 unless causes are identified.
    #[arg(long)]
    require: bool,
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
    let dataset = Dataset::read(&args.dataset)?;
    std::fs::create_dir_all(&args.out).map_err(|error| unwritable(&args.out, &error))?;
    drop(pending(&args.out.join("diagnosis.json"))?);
    lock(&args.out)?;
    let _ = ctrlc::set_handler(interrupt);
    let result = diagnose(args, options, &dataset);
    work().lock = None;
    result
}

/// Writes what was identified.
fn identified(args: &Args, options: Options, found: &Identification, page: &str, start: Instant) -> Result<ExitCode, Failure> {
    let json = serde_json::to_string_pretty(found).map_err(|error| unwritable(&args.out, &error))?;
    let remarks: String = found.remarks.iter().map(|remark| format!("{remark}\n")).collect();
    let printed = print(&if options.json { format!("{json}\n") } else { format!("{}\n{remarks}", found.summary) });
    work().writing = true;
    write(&args.out, "identified.toml", &found.file)?;
    write(&args.out, "report.html", page)?;
    write(&args.out, "identification.json", &format!("{json}\n"))?;
    options.remark(&format!("{:.0} s; the report is {}", start.elapsed().as_secs_f64(), args.out.join("report.html").display()));
    printed?;
    Ok(if args.require && !found.meets_all { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

fn diagnose(args: &Args, options: Options, dataset: &Dataset) -> Result<ExitCode, Failure> {
    let jobs = args.jobs.map_or_else(|| std::thread::available_parallelism().map_or(1, Into::into), usize::from);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(jobs)
        .build()
        .map_err(|error| Failure::Usage(format!("--jobs {jobs}: {error}")))?;
    let bar = if options.quiet { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
    if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed} {msg}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(std::time::Duration::from_millis(200));
    let start = Instant::now();
    let progress = |task: &str| bar.set_message(task.to_owned());
    let command = format!("sfers diagnose {} --out {}", args.dataset.display(), args.out.display());
    let answer = pool.install(|| answer::answer(dataset, &command, &progress));
    bar.finish_and_clear();
    let (diagnosis, files, page) = match answer? {
        Answer::Diagnosed { diagnosis, files, page } => (diagnosis, files, page),
        Answer::Identified { identification, page } => return identified(args, options, &identification, &page, start),
    };
    let json = serde_json::to_string_pretty(&diagnosis).map_err(|error| unwritable(&args.out, &error))?;
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
        write(&args.out, "extended.toml", &files.experiment)?;
        write(&args.out, "drive.csv", &files.drive)?;
        write(&args.out, "residuals.csv", &files.residuals)?;
    }
    write(&args.out, "report.html", &page)?;
    write(&args.out, "diagnosis.json", &format!("{json}\n"))?;
    options.remark(&format!("{:.0} s; the report is {}", start.elapsed().as_secs_f64(), args.out.join("report.html").display()));
    printed?;
    let identified = matches!(diagnosis.verdict, Verdict::Named | Verdict::Tied);
    Ok(if args.require && !identified { ExitCode::from(1) } else { ExitCode::SUCCESS })
}
