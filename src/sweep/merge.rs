//! From the files of rows to `results.csv` in the grid's order, with a manifest of who computed them.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::finished::rows_files;
use super::identity;
use super::journal::Note;
use super::rows::io;
use super::{Finished, Point, Row, RowError, Rows, Sweep};
use crate::date::{self, DateTime};
use crate::files::Pending;

/// Collects the rows of all files in `folder` and writes `results.csv` in the grid's order, and `manifest.json`. `warn` gets what is damaged.
///
/// # Errors
/// [`RowError::Incomplete`] if a point is in no file, when nothing is written; other [`RowError`]s if a file cannot be read or written.
pub fn merge(folder: &Path, sweep: &Sweep, warn: impl Fn(&str)) -> Result<PathBuf, RowError> {
    sweep.claim(folder)?;
    let finished = Finished::read(sweep.len(), rows_files(folder)?)?;
    finished.warnings().iter().for_each(|warning| warn(warning));
    if let Some(first) = (0..sweep.len()).find(|&index| !finished.has(index)) {
        let missing = sweep.len() - finished.found();
        return Err(RowError::Incomplete { missing, points: sweep.len(), first: Point::of(sweep, first) });
    }
    let path = folder.join("results.csv");
    let io_of_csv = |error: csv::Error| RowError::Io { path: path.clone(), reason: error.to_string() };
    let mut bytes = record(&sweep.header()).map_err(io_of_csv)?;
    bytes.push(b'\n');
    let axes: Result<Vec<Vec<Vec<u8>>>, _> =
        sweep.axes.iter().map(|axis| axis.values.iter().map(|value| record(&[plain(value)])).collect()).collect();
    let axes = axes.map_err(io_of_csv)?;
    let longest: usize = axes.iter().map(|values| 1 + values.iter().map(Vec::len).max().unwrap_or(0)).sum();
    bytes.reserve_exact(sweep.len() * longest + finished.bytes());
    for index in 0..sweep.len() {
        for (values, at) in axes.iter().zip(sweep.places(index)) {
            bytes.extend_from_slice(&values[at]);
            bytes.push(b',');
        }
        bytes.extend_from_slice(finished.cells(index).unwrap_or_default());
        bytes.push(b'\n');
    }
    replace(&path, &bytes)?;
    let manifest = manifest(folder, sweep, &finished);
    replace(&folder.join("manifest.json"), format!("{manifest:#}\n").as_bytes())?;
    Ok(path)
}

/// The finished rows in `folder`, in the grid's order.
///
/// # Errors
/// [`RowError`] as [`merge`], but points may be missing.
pub fn rows(folder: &Path, sweep: &Sweep) -> Result<Vec<Row>, RowError> {
    sweep.claim(folder)?;
    let finished = Finished::read(sweep.len(), rows_files(folder)?)?;
    Ok((0..sweep.len()).filter_map(|index| finished.row(index)).collect())
}

/// The points that no file in `folder` holds, sorted; all of a folder that does not exist yet. `warn` gets what is damaged.
///
/// # Errors
/// [`RowError`] if the folder is another sweep's, or a file cannot be read.
pub fn missing(folder: &Path, sweep: &Sweep, warn: impl Fn(&str)) -> Result<Vec<usize>, RowError> {
    if !identity::path(folder).exists() {
        return Ok((0..sweep.len()).collect());
    }
    sweep.check_identity(folder)?;
    let finished = Finished::read(sweep.len(), rows_files(folder)?)?;
    finished.warnings().iter().for_each(|warning| warn(warning));
    Ok((0..sweep.len()).filter(|&index| !finished.has(index)).collect())
}

/// Name of the file that rows of other folders go to.
const GATHERED: &str = "rows-gathered.csv";

/// Takes the rows of other folders of the same sweep, of another machine for example, into `folder`; returns the number of points that it did not have. `warn`
/// gets what is damaged.
///
/// # Errors
/// [`RowError`] if a folder is another sweep's or of another program, or two results of one point differ; no row is taken then.
pub fn gather(folder: &Path, sweep: &Sweep, others: &[PathBuf], warn: impl Fn(&str)) -> Result<usize, RowError> {
    for other in others {
        sweep.check_identity(other)?;
    }
    let mut rows = Rows::open(folder, sweep, GATHERED)?;
    let mut paths = rows_files(folder)?;
    let own = Finished::read(sweep.len(), paths.clone())?;
    for other in others {
        paths.extend(rows_files(other)?);
    }
    let all = Finished::read(sweep.len(), paths)?;
    all.warnings().iter().for_each(|warning| warn(warning));
    let new: Vec<usize> = (0..sweep.len()).filter(|&index| !own.has(index) && all.has(index)).collect();
    if !new.is_empty() {
        let theirs = all.files().iter().skip(own.files().len());
        theirs.flat_map(|file| &file.notes).try_for_each(|note| rows.note(note))?;
    }
    for row in new.iter().filter_map(|&index| all.row(index)) {
        rows.append(&row)?;
    }
    Ok(new.len())
}

/// Who computed the rows, on what and in what time, and the scripts that asked for it.
fn manifest(folder: &Path, sweep: &Sweep, finished: &Finished) -> Value {
    let iso = |seconds: u64| DateTime { seconds }.iso();
    let (mut wall_s, mut core_s) = (0.0, 0.0);
    let mut files = Vec::new();
    for file in finished.files() {
        let mut sessions: Vec<Value> = Vec::new();
        for note in &file.notes {
            match note {
                Note::Begin(begin) => sessions.push(json!({
                    "begin": iso(begin.begin_unix_s), "host": begin.host, "program": begin.program, "jobs": begin.jobs,
                    "scheduler_job": begin.scheduler_job, "end": null,
                })),
                Note::End(end) => {
                    wall_s += end.wall_s;
                    core_s += end.core_s.unwrap_or(0.0);
                    if let Some(session) = sessions.last_mut() {
                        session["end"] = iso(end.end_unix_s).into();
                        session["computed"] = end.computed.into();
                        session["wall_s"] = end.wall_s.into();
                        session["core_s"] = end.core_s.into();
                    }
                }
            }
        }
        files.push(json!({ "file": file.path.file_name().map(|name| name.to_string_lossy()), "sessions": sessions }));
    }
    json!({
        "schema": 1,
        "written": date::now().iso(),
        "command": std::env::args().collect::<Vec<_>>(),
        "version": env!("CARGO_PKG_VERSION"),
        "git_revision": env!("SFERS_GIT_REVISION"),
        "bullet": env!("SFERS_BULLET"),
        "points": sweep.len(),
        "without_measures": finished.failed(),
        "wall_s": wall_s,
        "core_s": core_s,
        "scripts": super::submit::scripts(folder),
        "files": files,
    })
}

/// A value as a cell: texts without the quotes of TOML.
fn plain(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// A line of CSV without its end.
fn record(fields: &[String]) -> Result<Vec<u8>, csv::Error> {
    let mut line = csv::Writer::from_writer(Vec::new());
    line.write_record(fields)?;
    let mut line = line.into_inner().map_err(|error| csv::Error::from(error.into_error()))?;
    line.pop();
    Ok(line)
}

fn replace(path: &Path, bytes: &[u8]) -> Result<(), RowError> {
    Pending::open(path).and_then(|pending| pending.finish(bytes)).map_err(io(path))
}
