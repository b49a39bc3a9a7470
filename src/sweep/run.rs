//! Computation of the missing points of a sweep.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::finished::rows_files;
use super::journal::Session;
use super::{Finished, Row, RowError, Rows, Shard, Sweep};
use crate::experiment::{Spread, ensemble};

/// Counts of a sweep's points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Outcome {
    /// Points computed by earlier runs.
    pub before: usize,
    /// Points computed by this run.
    pub computed: usize,
    /// Points of this shard whose status is not `ok`.
    pub failed: usize,
    /// True if `stop` ended the sweep early.
    pub interrupted: bool,
}

/// Computes the points of a shard that no file in `folder` holds, on `jobs` threads. A thread writes its row before it starts the next point.
/// `progress` gets the numbers of finished points and of all points of the shard; `stop` abandons the points in work; `warn` gets warnings
/// before the first point.
///
/// # Errors
/// [`RowError`] if a point is invalid, or the rows cannot be read or written; nothing is written for an invalid point of a new folder. A failed point is a row
/// with its reason.
pub fn run(
    sweep: &Sweep,
    folder: &Path,
    shard: Shard,
    jobs: usize,
    stop: &AtomicBool,
    progress: impl Fn(usize, usize) + Sync,
    warn: impl Fn(&str),
) -> Result<Outcome, RowError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build();
    let pool =
        pool.map_err(|error| RowError::Io { path: folder.into(), reason: format!("threads cannot be started: {error}") })?;
    let mine: Vec<usize> = shard.of(sweep.len()).collect();
    let is_new = !super::identity::path(folder).exists();
    if is_new {
        pool.install(|| sweep.check(&mine))?;
    }
    let rows = Rows::open(folder, sweep, &shard.file_name())?;
    rows.unlocked().into_iter().for_each(&warn);
    let finished = Finished::read(sweep.len(), others_and(&rows, folder, shard)?)?;
    finished.warnings().iter().for_each(|warning| warn(warning));
    let todo: Vec<usize> = mine.iter().copied().filter(|&index| !finished.has(index)).collect();
    let before = mine.len() - todo.len();
    let failed = mine.iter().filter(|&&index| finished.is_failed(index)).count();
    drop(finished);
    progress(before, mine.len());
    if todo.is_empty() {
        return Ok(Outcome { before, failed, ..Outcome::default() });
    }
    if !is_new {
        pool.install(|| sweep.check(&todo))?;
    }
    let work = Work {
        sweep,
        rows: Mutex::new(rows),
        computed: AtomicUsize::new(0),
        failed: AtomicUsize::new(failed),
        broken: AtomicBool::new(false),
        stop,
    };
    let (session, begin) = Session::begin(jobs);
    work.rows().note(&begin)?;
    let result = pool.install(|| {
        todo.par_iter().with_max_len(1).try_for_each(|&index| work.point(index, |done| progress(before + done, mine.len())))
    });
    let computed = work.computed.load(Ordering::Relaxed);
    let noted = work.rows().note(&session.end(computed));
    result.and(noted)?;
    Ok(Outcome { before, computed, failed: work.failed.load(Ordering::Relaxed), interrupted: computed < todo.len() })
}

/// The files that may hold points of a shard: its own, and those that were not divided the same way.
fn others_and(rows: &Rows, folder: &Path, shard: Shard) -> Result<Vec<PathBuf>, RowError> {
    let mut paths = rows_files(folder)?;
    paths.retain(|path| path == rows.path() || Shard::of_file(path).is_none_or(|other| other.count() != shard.count()));
    Ok(paths)
}

/// Whether all shards of a division have begun, so that their rows may be complete.
///
/// # Errors
/// [`RowError::Io`] if the folder cannot be read.
pub fn all_have_begun(folder: &Path, shard: Shard) -> Result<bool, RowError> {
    let of_division = |path: &PathBuf| Shard::of_file(path).is_some_and(|other| other.count() == shard.count());
    Ok(rows_files(folder)?.iter().filter(|path| of_division(path)).count() >= shard.count())
}

/// Mean time of some points on one thread (s), each given up after `limit`: then it is a lower bound, and the second value false. Nothing is kept.
///
/// # Errors
/// [`RowError::Foreign`] if a file changed since the sweep was read.
pub fn mean_time(sweep: &Sweep, points: &[usize], limit: Duration) -> Result<(f64, bool), RowError> {
    let (start, mut all_ended) = (Instant::now(), true);
    for &point in points {
        let begin = Instant::now();
        let row = compute(sweep, point, &|| begin.elapsed() > limit).map_err(changed)?;
        all_ended &= row.is_some();
    }
    Ok((start.elapsed().as_secs_f64() / points.len().max(1) as f64, all_ended))
}

fn changed(path: PathBuf) -> RowError {
    RowError::Foreign { path, reason: "changed while the sweep runs; put it back, or start again with another --out".into() }
}

/// What the threads share.
struct Work<'a> {
    sweep: &'a Sweep,
    rows: Mutex<Rows>,
    computed: AtomicUsize,
    failed: AtomicUsize,
    /// True after the first row that could not be written.
    broken: AtomicBool,
    stop: &'a AtomicBool,
}

impl Work<'_> {
    fn rows(&self) -> std::sync::MutexGuard<'_, Rows> {
        self.rows.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    fn given_up(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.broken.load(Ordering::Relaxed)
    }

    /// Computes a point and writes its row, unless the work was given up.
    fn point(&self, index: usize, progress: impl Fn(usize)) -> Result<(), RowError> {
        if self.given_up() {
            return Ok(());
        }
        let result = match compute(self.sweep, index, &|| self.given_up()) {
            Ok(None) => return Ok(()),
            Ok(Some(row)) => self.rows().append(&row).map(|()| row.status == "ok"),
            Err(path) => Err(changed(path)),
        };
        self.broken.fetch_or(result.is_err(), Ordering::Relaxed);
        self.failed.fetch_add(usize::from(!result?), Ordering::Relaxed);
        progress(self.computed.fetch_add(1, Ordering::Relaxed) + 1);
        Ok(())
    }
}

/// Runs one point, all members of its ensemble; `None` if it was abandoned.
///
/// # Errors
/// The path of a file that changed since the sweep was read.
fn compute(sweep: &Sweep, index: usize, given_up: &(impl Fn() -> bool + Sync)) -> Result<Option<Row>, PathBuf> {
    let members = sweep.members(index);
    if let Some(path) = sweep.changed(members.as_ref().ok().and_then(|members| members.first())) {
        return Err(path);
    }
    let measures = members.map_err(|error| error.to_string()).and_then(|mut members| {
        members.iter_mut().for_each(|member| member.record_only_what_measures_need(&sweep.measures));
        ensemble::run_members(&members, given_up)
    });
    let measures = match measures {
        Ok(None) => return Ok(None),
        Ok(Some(measures)) => measures,
        Err(reason) => {
            let none = vec![None; sweep.columns().len()];
            return Ok(Some(Row { index, measures: none, status: format!("failed: {reason}") }));
        }
    };
    let columns = |name: &String| match (&measures[..], sweep.is_ensemble) {
        ([alone], false) => vec![alone.get(name)],
        _ => ensemble::spread(&measures, name)
            .map_or(vec![None; Spread::PREFIXES.len()], |spread| spread.values().map(Some).to_vec()),
    };
    Ok(Some(Row { index, measures: sweep.measures.iter().flat_map(columns).collect(), status: "ok".into() }))
}
