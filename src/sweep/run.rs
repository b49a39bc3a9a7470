//! Computation of the missing points of a sweep.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::{Row, RowError, Rows, Sweep};
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

/// Computes the missing points of shard `shard` (from 1) of `shards` on `jobs` threads. A thread writes its row before it starts the next point.
/// `progress` gets the numbers of finished points and of all points of the shard; `stop` abandons the points in work; `warn` gets warnings
/// before the first point.
///
/// # Errors
/// [`RowError`] if the rows cannot be read or written. A failed point is a row with its reason.
pub fn run(
    sweep: &Sweep,
    folder: &Path,
    (shard, shards): (usize, usize),
    jobs: usize,
    stop: &AtomicBool,
    progress: impl Fn(usize, usize) + Sync,
    warn: impl Fn(&str),
) -> Result<Outcome, RowError> {
    let rows = Rows::open(folder, sweep, shard, shards)?;
    rows.unlocked().into_iter().for_each(warn);
    let mine: Vec<usize> = (0..sweep.len()).filter(|index| index % shards == shard - 1).collect();
    let todo: Vec<usize> = mine.iter().copied().filter(|index| !rows.done().contains_key(index)).collect();
    let before = mine.len() - todo.len();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build();
    let pool =
        pool.map_err(|error| RowError::Io { path: folder.into(), reason: format!("threads cannot be started: {error}") })?;
    progress(before, mine.len());
    let rows = Mutex::new(rows);
    let broken = AtomicBool::new(false);
    let given_up = || stop.load(Ordering::Relaxed) || broken.load(Ordering::Relaxed);
    let result = pool.install(|| {
        todo.par_iter().with_max_len(1).try_for_each(|&index| {
            if given_up() {
                return Ok(());
            }
            let row = compute(sweep, index, &given_up);
            let mut rows = rows.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            let result = match row {
                Ok(None) => return Ok(()),
                Ok(Some(row)) => rows.append(row),
                Err(path) => Err(RowError::Foreign {
                    path,
                    reason: "changed while the sweep runs; put it back, or start again with another --out".into(),
                }),
            };
            broken.fetch_or(result.is_err(), Ordering::Relaxed);
            progress(rows.done().len(), mine.len());
            result
        })
    });
    let rows = rows.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    result?;
    Ok(Outcome {
        before,
        computed: rows.done().len() - before,
        failed: rows.done().values().filter(|row| row.status != "ok").count(),
        interrupted: rows.done().len() < mine.len(),
    })
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
