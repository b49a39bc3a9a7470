//! Sweeps.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use pyo3::prelude::*;
use sfers::sweep::{self, Outcome, Shard, Sweep};

use crate::error;
use crate::experiment::toml_of;
use crate::interrupt::interruptible;

/// Computes the missing points of a sweep into `folder` on `jobs` threads; returns the path of its `results.csv` and the numbers of points that were there before, that were
/// computed, and that have no measures. `sweep` is a file or a preset, or a table in JSON. `progress` gets the numbers of finished and of all points.
#[pyfunction]
#[pyo3(signature = (file, table, folder, settings, jobs, progress=None))]
pub fn run_sweep(
    py: Python<'_>,
    file: Option<PathBuf>,
    table: Option<&str>,
    folder: PathBuf,
    settings: Vec<String>,
    jobs: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<(PathBuf, usize, usize, usize)> {
    let sweep = match (file, table) {
        (Some(file), _) => Sweep::open(&file, &settings),
        (None, Some(table)) => Sweep::from_text("the sweep", &toml_of(table)?, &folder),
        (None, None) => return Err(error::value("neither a file nor a table")),
    };
    let sweep = sweep.map_err(|e| error::of_config(&e))?;
    let told = Mutex::new(Ok(()));
    let result = interruptible(py, |stop| {
        let progress = |done: usize, points: usize| {
            let Some(progress) = &progress else { return };
            let result = Python::attach(|py| progress.call1(py, (done, points)).map(drop));
            if let Err(error) = result {
                stop.store(true, std::sync::atomic::Ordering::Relaxed);
                *told.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Err(error);
            }
        };
        run(&sweep, &folder, jobs, stop, progress)
    })?;
    told.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)?;
    let Outcome { before, computed, failed, .. } = result.map_err(|e| error::of_rows(&e))?;
    let results = sweep::merge(&folder, &sweep, |_| {}).map_err(|e| error::of_rows(&e))?;
    Ok((results, before, computed, failed))
}

fn run(
    sweep: &Sweep,
    folder: &Path,
    jobs: usize,
    stop: &std::sync::atomic::AtomicBool,
    progress: impl Fn(usize, usize) + Sync,
) -> Result<Outcome, sweep::RowError> {
    sweep::run(sweep, folder, Shard::ALL, jobs, stop, progress, |_| {})
}
