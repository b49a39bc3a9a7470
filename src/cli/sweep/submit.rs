//! `sfers sweep --submit`.

use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use super::{Args, warn};
use crate::cli::submit::{Work, absolute, ended, submit as hand_over};
use crate::cli::{Failure, Options};
use crate::sweep::submit::Scheduler;
use crate::sweep::{self, Sweep};

/// A point is timed at most this long.
const LONGEST_TRIAL: Duration = Duration::from_secs(20);

/// Writes job scripts for the missing points, and submits them if that is wanted.
pub fn submit(file: &Path, out: &Path, args: &Args, scheduler: Scheduler, options: Options) -> Result<ExitCode, Failure> {
    let sweep = Sweep::open(file, &args.settings)?;
    let folder = absolute(out)?;
    let earlier = ended(&folder)?;
    if args.keep_rows && !args.cluster.dry_run {
        sweep::adopt(&folder, &sweep)?;
    }
    let missing = sweep::missing(&folder, &sweep, warn)?;
    if missing.is_empty() {
        options.remark("all points are computed: nothing to submit; --merge collects the results");
        return Ok(ExitCode::SUCCESS);
    }
    sweep.check(&missing)?;
    let sample = [missing[0], missing[missing.len() / 2], missing[missing.len() - 1]];
    let (point_s, all_ended) = sweep::mean_time(&sweep, &sample, LONGEST_TRIAL)?;
    let at_least = if all_ended { "" } else { "at least " };
    options.remark(&format!("{} points, each {at_least}{point_s:.3} s on one thread here, by three of them", missing.len()));
    let work = Work {
        name: name(file),
        arguments: arguments(file, &folder, args)?,
        pieces: sweep.len(),
        missing,
        piece_s: Some(point_s),
        threads: args.jobs.unwrap_or(1),
        folder: folder.clone(),
    };
    let claim = || sweep::claim(&folder, &sweep).map_err(Failure::from);
    hand_over(work, &args.cluster, scheduler, earlier.map(|earlier| earlier.shards), claim, options)
}

/// The file's name without its end, of letters that schedulers take.
fn name(file: &Path) -> String {
    let stem = file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let stem = stem.rsplit(':').next().unwrap_or_default();
    stem.chars().map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '-' }).collect()
}

/// The arguments of the jobs' command.
fn arguments(file: &Path, folder: &Path, args: &Args) -> Result<Vec<String>, Failure> {
    let file = if file.exists() { absolute(file)? } else { file.to_owned() };
    let mut arguments = vec!["sweep".into(), file.display().to_string(), "--out".into(), folder.display().to_string()];
    arguments.extend(args.settings.iter().flat_map(|setting| ["--set".into(), setting.clone()]));
    if args.keep_rows {
        arguments.push("--keep-rows".into());
    }
    Ok(arguments)
}
