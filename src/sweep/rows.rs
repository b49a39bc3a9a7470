//! Finished rows on disk: one append-only file per shard, so that a killed process loses only the points in work.
//!
//! One call writes one row, its index first and a line end last. A line without its end was cut off by a kill or a full disk; it is removed and
//! its point computed again.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::Sweep;
use crate::files::{self, Pending};

/// One finished point.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Index of the point in the grid.
    pub index: usize,
    /// The measures, in the order of the sweep's [`columns`](Sweep::columns).
    pub measures: Vec<Option<f64>>,
    /// `ok`, or the reason for missing measures.
    pub status: String,
}

/// Rows that cannot be read or written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RowError {
    /// The folder holds results of another sweep, or a file that is not one of rows.
    #[error("{}: {reason}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The difference.
        reason: String,
    },
    /// Another revision of the program, or one with another Bullet, computed the rows.
    #[error("{}: its rows were computed by {theirs}, and this is {ours}; continue with that program, or choose another --out", path.display())]
    OtherProgram {
        /// The file with the identity.
        path: PathBuf,
        /// The programs that computed the rows.
        theirs: String,
        /// This program.
        ours: String,
    },
    /// A file could not be read or written; finished rows stay as they are.
    #[error("{}: {reason}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// Points are missing.
    #[error(
        "{missing} of {points} points are missing, the first of them point {first} ({values}); run the shards that hold them"
    )]
    Incomplete {
        /// Number of missing points.
        missing: usize,
        /// Number of points of the sweep.
        points: usize,
        /// Index of the first missing point.
        first: usize,
        /// Keys and values of that point.
        values: String,
    },
}

fn io(path: &Path) -> impl Fn(std::io::Error) -> RowError + '_ {
    move |error| RowError::Io { path: path.into(), reason: error.to_string() }
}

/// The rows of one shard, open for appending.
#[derive(Debug)]
pub struct Rows {
    path: PathBuf,
    file: File,
    done: BTreeMap<usize, Row>,
    unlocked: Option<String>,
}

impl Rows {
    /// Opens the rows of shard `shard` (from 1) of `shards` in `folder`, creates both if missing, and checks that the folder belongs to this sweep. The
    /// file is locked until the rows are dropped, if the file system has locks.
    ///
    /// # Errors
    /// [`RowError`] if the folder is another sweep's, another process works on the shard, or the file cannot be read.
    pub fn open(folder: &Path, sweep: &Sweep, shard: usize, shards: usize) -> Result<Self, RowError> {
        Self::open_with(folder, sweep, shard, shards, File::try_lock)
    }

    fn open_with(
        folder: &Path,
        sweep: &Sweep,
        shard: usize,
        shards: usize,
        lock: impl Fn(&File) -> Result<(), TryLockError>,
    ) -> Result<Self, RowError> {
        std::fs::create_dir_all(folder).map_err(io(folder))?;
        sweep.claim(folder)?;
        let path = folder.join(format!("rows-{shard}-of-{shards}.csv"));
        if path.metadata().is_ok_and(|there| !there.is_file()) {
            return Err(RowError::Io { path, reason: "is not a regular file".into() });
        }
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(&path).map_err(io(&path))?;
        let unlocked = match lock(&file) {
            Ok(()) => None,
            Err(TryLockError::WouldBlock) => {
                let reason = "another sfers is working on it; wait for it, or give each process its own shard".into();
                return Err(RowError::Io { path, reason });
            }
            Err(TryLockError::Error(error)) if files::cannot_lock(&error) => Some(format!(
                "{}: this file system cannot lock files ({error}): two processes must not work on the same shard",
                path.display()
            )),
            Err(TryLockError::Error(error)) => return Err(io(&path)(error)),
        };
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(io(&path))?;
        let whole = whole_lines(&bytes).len();
        if whole < bytes.len() {
            file.set_len(whole as u64).map_err(io(&path))?;
            file.seek(SeekFrom::End(0)).map_err(io(&path))?;
        }
        let done = parse(&path, &bytes[..whole], sweep)?;
        Ok(Self { path, file, done, unlocked })
    }

    /// A warning if the file system has no locks.
    pub fn unlocked(&self) -> Option<&str> {
        self.unlocked.as_deref()
    }

    /// The finished rows by index.
    pub fn done(&self) -> &BTreeMap<usize, Row> {
        &self.done
    }

    /// Appends a row; a kill of the process cannot undo it.
    ///
    /// # Errors
    /// [`RowError::Io`] if the row cannot be written; earlier rows are unchanged.
    pub fn append(&mut self, row: Row) -> Result<(), RowError> {
        let mut line = csv::Writer::from_writer(Vec::new());
        let fields = std::iter::once(row.index.to_string()).chain(cells(&row)).chain([row.status.clone()]);
        let io_of_csv = |error: csv::Error| RowError::Io { path: self.path.clone(), reason: error.to_string() };
        line.write_record(fields).map_err(io_of_csv)?;
        let line = line.into_inner().map_err(|error| RowError::Io { path: self.path.clone(), reason: error.to_string() })?;
        let before = self.file.metadata().map_err(io(&self.path))?.len();
        if let Err(error) = self.file.write_all(&line) {
            // Removes a partial line.
            let _ = self.file.set_len(before);
            return Err(io(&self.path)(error));
        }
        self.done.insert(row.index, row);
        Ok(())
    }
}

fn replace(path: &Path, bytes: &[u8]) -> Result<(), RowError> {
    Pending::open(path).and_then(|pending| pending.finish(bytes)).map_err(io(path))
}

/// A value as a cell: texts without the quotes of TOML.
fn plain(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// The measures as cells; empty for missing ones.
fn cells(row: &Row) -> impl Iterator<Item = String> + '_ {
    row.measures.iter().map(|m| m.map_or_else(String::new, |m| format!("{m:?}")))
}

/// The bytes up to the last line end.
fn whole_lines(bytes: &[u8]) -> &[u8] {
    &bytes[..bytes.iter().rposition(|&b| b == b'\n').map_or(0, |end| end + 1)]
}

fn parse(path: &Path, bytes: &[u8], sweep: &Sweep) -> Result<BTreeMap<usize, Row>, RowError> {
    let foreign = |line: usize, reason: &str| RowError::Foreign { path: path.into(), reason: format!("line {line}: {reason}") };
    let columns = sweep.columns().len();
    let mut rows = BTreeMap::new();
    let reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(bytes);
    for (line, record) in reader.into_records().enumerate() {
        let line = line + 1;
        let record = record.map_err(|error| foreign(line, &error.to_string()))?;
        if record.len() != columns + 2 {
            return Err(foreign(line, "does not have the fields of a row of this sweep"));
        }
        let index = record[0].parse().ok().filter(|&index: &usize| index < sweep.len());
        let index = index.ok_or_else(|| foreign(line, "does not begin with the index of a point"))?;
        let number = |text: &str| match text {
            "" => Ok(None),
            _ => text.parse().map(Some).map_err(|_| foreign(line, &format!("{text:?} is not a number"))),
        };
        let measures = record.iter().skip(1).take(columns).map(number).collect::<Result<_, _>>()?;
        rows.insert(index, Row { index, measures, status: record[record.len() - 1].to_owned() });
    }
    Ok(rows)
}

/// Collects the rows of all shards in `folder` and writes `results.csv` in the grid's order.
///
/// # Errors
/// [`RowError::Incomplete`] if a point is in no shard, when nothing is written; other [`RowError`]s if a file cannot be read or written.
pub fn merge(folder: &Path, sweep: &Sweep) -> Result<PathBuf, RowError> {
    sweep.claim(folder)?;
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(io(folder))? {
        let path = entry.map_err(io(folder))?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if name.starts_with("rows-") && name.ends_with(".csv") {
            let bytes = files::read(&path).map_err(io(&path))?;
            all.append(&mut parse(&path, whole_lines(&bytes), sweep)?);
        }
    }
    if all.len() < sweep.len() {
        let first = (0..sweep.len()).find(|index| !all.contains_key(index)).unwrap_or_default();
        let named = sweep.axes.iter().zip(sweep.point(first)).map(|(axis, value)| format!("{} = {value}", axis.key));
        return Err(RowError::Incomplete {
            missing: sweep.len() - all.len(),
            points: sweep.len(),
            first,
            values: named.collect::<Vec<_>>().join(", "),
        });
    }
    let path = folder.join("results.csv");
    let io_of_csv = |error: csv::Error| RowError::Io { path: path.clone(), reason: error.to_string() };
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(sweep.header()).map_err(io_of_csv)?;
    for row in all.values() {
        let values = sweep.point(row.index).into_iter().map(plain);
        writer.write_record(values.chain(cells(row)).chain([row.status.clone()])).map_err(io_of_csv)?;
    }
    let bytes = writer.into_inner().map_err(|error| RowError::Io { path: path.clone(), reason: error.to_string() })?;
    replace(&path, &bytes)?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use std::io::Error;

    use super::*;

    const TEXT: &str = "experiment = \"preset:cantilever-dc\"\nmeasures = [\"tip_deflection_mm\"]\n[vary]\n\
        \"simulation.engine\" = [\"planar\", \"bullet\"]\n";

    /// ENOTSUP, ENOLCK and ENOSYS of Linux, as Lustre without flock and old network file systems return them.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_system_that_cannot_lock_is_warned_of_and_the_rows_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let sweep = Sweep::from_text("s.toml", TEXT, Path::new("")).unwrap();
        for code in [95, 37, 38] {
            let lock = |_: &File| Err(TryLockError::Error(Error::from_raw_os_error(code)));
            let mut rows = Rows::open_with(folder.path(), &sweep, 1, 1, lock).unwrap();
            assert!(rows.unlocked().unwrap().contains("cannot lock"), "{code}");
            rows.append(Row { index: 0, measures: vec![Some(1.5)], status: "ok".into() }).unwrap();
        }
        let failing = |_: &File| Err(TryLockError::Error(Error::from_raw_os_error(5)));
        assert!(Rows::open_with(folder.path(), &sweep, 1, 1, failing).is_err(), "an input/output error is no lack of locks");
        let rows = Rows::open(folder.path(), &sweep, 1, 1).unwrap();
        assert_eq!((rows.unlocked(), rows.done()[&0].measures[0]), (None, Some(1.5)));
    }

    #[test]
    fn words_are_cells_without_quotes() {
        let folder = tempfile::tempdir().unwrap();
        let sweep = Sweep::from_text("s.toml", TEXT, Path::new("")).unwrap();
        let mut rows = Rows::open(folder.path(), &sweep, 1, 1).unwrap();
        for index in 0..2 {
            rows.append(Row { index, measures: vec![None], status: "ok".into() }).unwrap();
        }
        let text = std::fs::read_to_string(merge(folder.path(), &sweep).unwrap()).unwrap();
        assert_eq!(text, "simulation.engine,tip_deflection_mm,status\nplanar,,ok\nbullet,,ok\n");
    }
}
