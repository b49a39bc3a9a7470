//! `sfers sweep`: many runs over a grid of values.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::{Failure, INTERRUPTED, Options, print, say};
use crate::sweep::{self, Outcome, RowError, Sweep};

/// Run an experiment over a grid of values; results in DIR/results.csv.
///
/// The same command resumes a sweep that was killed.
///
/// Example: sfers preset jump-on-time-scan > scan.toml && sfers sweep scan.toml --out scan
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The sweep file, preset:NAME, or NAME where there is no such file.
    sweep: PathBuf,
    /// Folder of the results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of runs at a time; by default one per processor.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Compute only every N-th point, beginning with the K-th, and leave the others to other machines.
    #[arg(long, value_name = "K/N", value_parser = shard)]
    shard: Option<(usize, usize)>,
    /// Compute nothing: collect the rows-*.csv of all shards in DIR into DIR/results.csv, if no point is missing.
    #[arg(long, conflicts_with_all = ["shard", "jobs"])]
    merge: bool,
    /// Override a key of the experiment, or the value of a key in [vary] that has only one. May be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<String>,
    /// Keep the rows in DIR that another revision of the program, or one with another Bullet, computed, and continue with this one.
    #[arg(long)]
    keep_rows: bool,
}

fn shard(text: &str) -> Result<(usize, usize), String> {
    let parse = |text: &str| text.parse::<usize>().ok();
    match text.split_once('/').and_then(|(k, n)| Some((parse(k)?, parse(n)?))) {
        Some((k, n)) if (1..=n).contains(&k) => Ok((k, n)),
        _ => Err("a shard is written K/N with K from 1 to N, for example 1/4".into()),
    }
}

static INTERRUPT: AtomicBool = AtomicBool::new(false);

impl From<RowError> for Failure {
    fn from(error: RowError) -> Self {
        match error {
            RowError::Foreign { .. } | RowError::OtherProgram { .. } | RowError::Io { .. } => Self::Usage(error.to_string()),
            RowError::Incomplete { .. } => Self::Data(error.to_string()),
        }
    }
}

pub fn run(args: &Args, options: Options) -> Result<ExitCode, Failure> {
    let sweep = Sweep::open(&args.sweep, &args.settings)?;
    let start = Instant::now();
    if args.keep_rows {
        sweep::adopt(&args.out, &sweep)?;
    }
    let advise = |error| match error {
        RowError::OtherProgram { .. } => Failure::Usage(format!("{error}, or keep its rows with --keep-rows")),
        other => other.into(),
    };
    let outcome = if args.merge { None } else { Some(compute(args, &sweep, options).map_err(advise)?) };
    let wall_s = start.elapsed().as_secs_f64();
    let interrupted = outcome.is_some_and(|outcome| outcome.interrupted);
    // The last shard to end finds all rows; the others leave the results to the merge.
    let results = match sweep::merge(&args.out, &sweep) {
        Ok(path) => Some(path),
        Err(RowError::Incomplete { .. }) if !args.merge => None,
        Err(error) => return Err(advise(error)),
    };
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

fn compute(args: &Args, sweep: &Sweep, options: Options) -> Result<Outcome, RowError> {
    let _ = ctrlc::set_handler(|| INTERRUPT.store(true, Ordering::Relaxed));
    let bar = if options.quiet { ProgressBar::hidden() } else { ProgressBar::new(0) };
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} points  {per_sec}  {eta} left") {
        bar.set_style(style);
    }
    let jobs = args.jobs.map_or_else(|| std::thread::available_parallelism().map_or(1, Into::into), usize::from);
    let first = AtomicBool::new(true);
    let progress = |done: usize, points: usize| {
        bar.set_length(points as u64);
        bar.set_position(done as u64);
        if first.swap(false, Ordering::Relaxed) {
            // Points of earlier runs do not count for the speed.
            bar.reset_eta();
        }
    };
    let warn = |warning: &str| say(&format!("warning: {warning}"));
    let outcome = sweep::run(sweep, &args.out, args.shard.unwrap_or((1, 1)), jobs, &INTERRUPT, progress, warn);
    bar.finish_and_clear();
    outcome
}
