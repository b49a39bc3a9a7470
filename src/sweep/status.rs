//! How far a sweep is, from the files in its folder alone.

use std::fs::{File, TryLockError};
use std::path::Path;
use std::time::UNIX_EPOCH;

use serde::Serialize;

use super::finished::{Content, rows_files};
use super::journal::{Note, host};
use super::{Finished, RowError, Shard, identity};
use crate::date;

/// A file on another machine that changed within this time is at work, where locks do not tell (s).
const RECENT_S: u64 = 60;

/// What the process of a shard does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// All its points are computed.
    Done,
    /// A process works on it.
    Running,
    /// Its process was interrupted or could not go on; points are missing.
    Stopped,
    /// Its process was killed; points are missing.
    Killed,
}

/// A file of rows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FileStatus {
    /// Its name.
    pub file: String,
    /// What its process does.
    pub state: State,
    /// Number of its rows.
    pub rows: usize,
    /// The machine of its last process.
    pub host: Option<String>,
    /// Rows per second of a running process.
    pub rate_per_s: Option<f64>,
}

/// How far a sweep is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Status {
    /// Number of points.
    pub points: usize,
    /// Number of computed points.
    pub computed: usize,
    /// Number of those without measures.
    pub failed: usize,
    /// Number of shards; `None` if only one process at a time worked in the folder.
    pub shards: Option<usize>,
    /// Number of shards that have no file yet.
    pub not_begun: usize,
    /// The files of rows.
    pub files: Vec<FileStatus>,
    /// Points per second of all running processes.
    pub rate_per_s: Option<f64>,
    /// Time that the missing points take at this rate (s).
    pub left_s: Option<f64>,
    /// What is damaged.
    pub warnings: Vec<String>,
}

impl Status {
    /// Reads the folder of a sweep. `shards` is their number, if it is known.
    ///
    /// # Errors
    /// [`RowError`] if it is no folder of a sweep, or a file cannot be read.
    pub fn read(folder: &Path, shards: Option<usize>) -> Result<Self, RowError> {
        let path = identity::path(folder);
        let Some(identity) = identity::read(&path)? else {
            return Err(RowError::Foreign {
                path,
                reason: "is not there: this is no folder of a sweep, or its first run has not begun".into(),
            });
        };
        let lengths = identity["vary"].as_array().into_iter().flatten().map(|axis| axis["values"].as_array().map_or(0, Vec::len));
        let points = lengths.product();
        let paths = rows_files(folder)?;
        let finished = Finished::read(points, paths.clone())?;
        let files: Vec<_> = finished.files().iter().map(|file| file_status(file, &finished, points)).collect();
        let of_files: Vec<Shard> = paths.iter().filter_map(|path| Shard::of_file(path)).collect();
        let shards = shards.or_else(|| of_files.iter().map(|shard| shard.count()).max().filter(|&count| count > 1));
        let begun = of_files.iter().filter(|shard| Some(shard.count()) == shards).count();
        let rates: Vec<f64> = files.iter().filter_map(|file| file.rate_per_s).collect();
        let rate_per_s = (!rates.is_empty()).then(|| rates.iter().sum::<f64>()).filter(|&rate| rate > 0.0);
        Ok(Self {
            points,
            computed: finished.found(),
            failed: finished.failed(),
            shards,
            not_begun: shards.map_or(0, |shards| shards.saturating_sub(begun)),
            files,
            rate_per_s,
            left_s: rate_per_s.map(|rate| (points - finished.found()) as f64 / rate),
            warnings: finished.warnings().to_vec(),
        })
    }

    /// Number of missing points.
    pub fn missing(&self) -> usize {
        self.points - self.computed
    }

    /// Number of files in a state.
    pub fn count(&self, state: State) -> usize {
        self.files.iter().filter(|file| file.state == state).count()
    }
}

fn file_status(file: &Content, finished: &Finished, points: usize) -> FileStatus {
    let Content { path, notes, rows, since_begin, .. } = file;
    let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let begin = notes.iter().rev().find_map(|note| if let Note::Begin(begin) = note { Some(begin) } else { None });
    let changed_unix_s = changed_unix_s(path);
    let recent = changed_unix_s + RECENT_S > date::now().seconds;
    let elsewhere = begin.is_some_and(|begin| begin.host != host());
    let ended = !matches!(notes.last(), Some(Note::Begin(_)));
    // Rows that were gathered from other folders belong to no shard, and nobody works on them.
    let complete = Shard::of_file(path).is_none_or(|shard| shard.of(points).all(|index| finished.has(index)));
    let state = match (complete, is_locked(path)) {
        (true, _) => State::Done,
        (false, true) => State::Running,
        (false, false) if ended => State::Stopped,
        (false, false) if elsewhere && recent => State::Running,
        (false, false) => State::Killed,
    };
    let rate_per_s = begin
        .filter(|_| state == State::Running)
        .map(|begin| *since_begin as f64 / (changed_unix_s.saturating_sub(begin.begin_unix_s).max(1)) as f64);
    FileStatus { file: name, state, rows: *rows, host: begin.map(|begin| begin.host.clone()), rate_per_s }
}

/// True if a process has locked the file. For the moment of the question this process shares the lock; a shard that starts waits for that long.
fn is_locked(path: &Path) -> bool {
    File::open(path).is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
}

/// Time of the last change since 1970 (s).
fn changed_unix_s(path: &Path) -> u64 {
    let changed = path.metadata().and_then(|there| there.modified()).unwrap_or(UNIX_EPOCH);
    changed.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
}
