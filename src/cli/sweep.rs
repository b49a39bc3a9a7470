//! `sfers sweep`: many runs over a grid of values.

mod status;
mod submit;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::{Failure, INTERRUPTED, Options, print, say};
use crate::sweep::{self, Outcome, RowError, Shard, Sweep};

/// What --status and --cancel do not go with.
const OTHERS: [&str; 9] = ["sweep", "out", "jobs", "merge", "settings", "keep_rows", "shard", "submit", "shards"];

/// Run an experiment over a grid of values; results in DIR/results.csv.
///
/// The same command resumes a sweep that was killed. --submit hands it to a cluster, --status DIR says how far it is.
///
/// Example: sfers preset jump-on-time-scan > scan.toml && sfers sweep scan.toml --out scan
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The sweep file, preset:NAME, or NAME where there is no such file.
    #[arg(required_unless_present_any = ["status", "cancel"])]
    sweep: Option<PathBuf>,
    /// Folder of the results.
    #[arg(long, value_name = "DIR", required_unless_present_any = ["status", "cancel"])]
    out: Option<PathBuf>,
    /// Number of runs at a time; by default one per processor, in jobs of a cluster one.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Compute nothing: collect the rows-*.csv of all shards in DIR into DIR/results.csv, if no point is missing.
    #[arg(long, conflicts_with_all = ["shard", "jobs", "submit"])]
    merge: bool,
    /// Take the rows of another folder of the same sweep, of another cluster for example, into DIR before merging. May be repeated.
    #[arg(long, value_name = "DIR", requires = "merge")]
    from: Vec<PathBuf>,
    /// Override a key of the experiment, or the value of a key in [vary] that has only one. May be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<String>,
    /// Keep the rows in DIR that another revision of the program, or one with another Bullet, computed, and continue with this one.
    #[arg(long)]
    keep_rows: bool,
    #[command(flatten)]
    cluster: super::submit::Args,
    /// Say how far the sweep in DIR is, and compute nothing.
    #[arg(long, value_name = "DIR", conflicts_with_all = OTHERS, help_heading = "On a cluster")]
    status: Option<PathBuf>,
    /// Cancel the jobs that were submitted for DIR; finished points stay.
    #[arg(long, value_name = "DIR", conflicts_with_all = OTHERS, conflicts_with = "status", help_heading = "On a cluster")]
    cancel: Option<PathBuf>,
}

static INTERRUPT: AtomicBool = AtomicBool::new(false);

impl From<RowError> for Failure {
    fn from(error: RowError) -> Self {
        match error {
            RowError::Foreign { .. } | RowError::Io { .. } => Self::Usage(error.to_string()),
            RowError::OtherProgram { .. } => Self::Usage(format!("{error}, or keep its rows with --keep-rows")),
            RowError::Invalid(error) => error.into(),
            RowError::Incomplete { .. } | RowError::Contradiction { .. } => Self::Data(error.to_string()),
        }
    }
}

pub fn run(args: &Args, options: Options) -> Result<ExitCode, Failure> {
    if let Some(folder) = &args.status {
        return status::status(folder, options);
    }
    if let Some(folder) = &args.cancel {
        return status::cancel(folder, options);
    }
    let (Some(file), Some(out)) = (&args.sweep, &args.out) else {
        return Err(Failure::Usage("a sweep file and --out are needed".into()));
    };
    if let Some(scheduler) = args.cluster.submit {
        return submit::submit(file, out, args, scheduler, options);
    }
    let shard = args.cluster.shard()?;
    let sweep = Sweep::open(file, &args.settings)?;
    let start = Instant::now();
    if args.keep_rows {
        sweep::adopt(out, &sweep)?;
    }
    let outcome = if args.merge { None } else { Some(compute(args, &sweep, out, shard, options)?) };
    if !args.from.is_empty() {
        let gathered = sweep::gather(out, &sweep, &args.from, warn)?;
        options.remark(&format!("{gathered} points taken from other folders"));
    }
    let wall_s = start.elapsed().as_secs_f64();
    let interrupted = outcome.is_some_and(|outcome| outcome.interrupted);
    let results = results(args, &sweep, out, shard, outcome)?;
    let Outcome { before, computed, failed, .. } = outcome.unwrap_or_default();
    if let Some(outcome) = outcome {
        options.remark(&format!(
            "{} points computed in {wall_s:.1} s, {} there before, {} without measures",
            outcome.computed, outcome.before, outcome.failed
        ));
    }
    if interrupted {
        say("interrupted; the same command resumes the sweep");
    } else if results.is_none() {
        options.remark("other shards are missing; collect their rows-*.csv in one folder and use --merge");
    }
    if options.json {
        let object = json!({
            "schema": 1, "points": sweep.len(), "before": before, "computed": computed, "failed": failed,
            "interrupted": interrupted, "results": results, "wall_s": wall_s,
        });
        print(&format!("{object}\n"))?;
    } else if let Some(path) = &results {
        print(&format!("{}\n", path.display()))?;
    }
    Ok(if interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// Writes the results if no point is missing; whoever ends last finds all rows.
fn results(args: &Args, sweep: &Sweep, out: &Path, shard: Shard, outcome: Option<Outcome>) -> Result<Option<PathBuf>, Failure> {
    if outcome.is_some_and(|outcome| outcome.interrupted) || !args.merge && !sweep::all_have_begun(out, shard)? {
        return Ok(None);
    }
    match sweep::merge(out, sweep, warn) {
        Ok(path) => Ok(Some(path)),
        Err(RowError::Incomplete { .. }) if !args.merge => Ok(None),
        Err(error) => Err(error.into()),
    }
}

fn warn(warning: &str) {
    say(&format!("warning: {warning}"));
}

fn compute(args: &Args, sweep: &Sweep, out: &Path, shard: Shard, options: Options) -> Result<Outcome, RowError> {
    let _ = ctrlc::set_handler(|| INTERRUPT.store(true, Ordering::Relaxed));
    let bar = if options.quiet { ProgressBar::hidden() } else { ProgressBar::new(0) };
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} points  {per_sec}  {eta} left") {
        bar.set_style(style);
    }
    let jobs = args.cluster.jobs(args.jobs);
    let first = AtomicBool::new(true);
    let progress = |done: usize, points: usize| {
        bar.set_length(points as u64);
        bar.set_position(done as u64);
        if first.swap(false, Ordering::Relaxed) {
            // Points of earlier runs do not count for the speed.
            bar.reset_eta();
        }
    };
    let outcome = sweep::run(sweep, out, shard, jobs, &INTERRUPT, progress, warn);
    bar.finish_and_clear();
    outcome
}
