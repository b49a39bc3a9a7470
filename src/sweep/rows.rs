//! Finished rows on disk: one file per shard that only grows, so that a kill loses nothing but the points being computed.
//!
//! Each row is written by one call, with its index in front and a line end behind. A line without its end was cut off by a kill or a full
//! disk: it is taken away and its point computed again.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::Sweep;
use crate::files::Pending;

/// One finished point.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Which point of the grid.
    pub index: usize,
    /// The measures, in the sweep's order.
    pub measures: Vec<Option<f64>>,
    /// `ok`, or why there are no measures.
    pub status: String,
}

/// Rows that cannot be read or written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RowError {
    /// The folder holds another sweep's results, or rows that are not of this sweep.
    #[error("{}: {reason}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
    /// A file could not be read or written; finished rows stay as they are.
    #[error("{}: {reason}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// Not all points are there.
    #[error(
        "{missing} of {points} points are missing, the first of them point {first} ({values}); run the shards that hold them"
    )]
    Incomplete {
        /// How many.
        missing: usize,
        /// Of how many.
        points: usize,
        /// Index of the first.
        first: usize,
        /// Its values.
        values: String,
    },
}

fn io(path: &Path) -> impl Fn(std::io::Error) -> RowError + '_ {
    move |error| RowError::Io { path: path.into(), reason: error.to_string() }
}

/// The rows of one shard, open for more.
#[derive(Debug)]
pub struct Rows {
    path: PathBuf,
    file: File,
    done: BTreeMap<usize, Row>,
}

impl Rows {
    /// Opens the rows of shard `shard` (from 1) of `shards` in `folder`, which is made if need be, and checks that the folder is this
    /// sweep's. The file is locked until the rows are dropped.
    ///
    /// # Errors
    /// [`RowError`].
    pub fn open(folder: &Path, sweep: &Sweep, shard: usize, shards: usize) -> Result<Self, RowError> {
        std::fs::create_dir_all(folder).map_err(io(folder))?;
        claim(folder, sweep)?;
        let path = folder.join(format!("rows-{shard}-of-{shards}.csv"));
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(&path).map_err(io(&path))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let reason = "another sfers is working on it; wait for it, or give every process a shard of its own".into();
                return Err(RowError::Io { path, reason });
            }
            Err(TryLockError::Error(error)) => return Err(io(&path)(error)),
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(io(&path))?;
        let whole = bytes.iter().rposition(|&b| b == b'\n').map_or(0, |end| end + 1);
        if whole < bytes.len() {
            file.set_len(whole as u64).map_err(io(&path))?;
            file.seek(SeekFrom::End(0)).map_err(io(&path))?;
        }
        let done = parse(&path, &bytes[..whole], sweep)?;
        Ok(Self { path, file, done })
    }

    /// The rows that are there.
    pub fn done(&self) -> &BTreeMap<usize, Row> {
        &self.done
    }

    /// Adds a row, on disk as soon as this returns to the extent that a kill of the process cannot undo it.
    ///
    /// # Errors
    /// [`RowError::Io`]; the rows before stay intact.
    pub fn append(&mut self, row: Row) -> Result<(), RowError> {
        let mut line = csv::Writer::from_writer(Vec::new());
        let measures = row.measures.iter().map(|m| m.map_or_else(String::new, |m| format!("{m:?}")));
        let fields = std::iter::once(row.index.to_string()).chain(measures).chain([row.status.clone()]);
        let io_of_csv = |error: csv::Error| RowError::Io { path: self.path.clone(), reason: error.to_string() };
        line.write_record(fields).map_err(io_of_csv)?;
        let line = line.into_inner().map_err(|error| RowError::Io { path: self.path.clone(), reason: error.to_string() })?;
        let before = self.file.metadata().map_err(io(&self.path))?.len();
        if let Err(error) = self.file.write_all(&line) {
            // What was written of it would end the file in the middle of a line.
            let _ = self.file.set_len(before);
            return Err(io(&self.path)(error));
        }
        self.done.insert(row.index, row);
        Ok(())
    }
}

/// Leaves the sweep's identity in the folder, or checks that it is there already.
fn claim(folder: &Path, sweep: &Sweep) -> Result<(), RowError> {
    let path = folder.join("sweep.json");
    let identity = format!("{:#}\n", sweep.identity());
    match std::fs::read_to_string(&path) {
        Ok(found) if found == identity => return Ok(()),
        Ok(_) => {
            let reason = "holds the results of another sweep (or of another version of the program); choose another --out, or \
                          remove the folder"
                .into();
            return Err(RowError::Foreign { path, reason });
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
        Err(error) => return Err(io(&path)(error)),
    }
    // Two shards may start together: whoever comes second finds the same text.
    replace(&path, identity.as_bytes())
}

fn replace(path: &Path, bytes: &[u8]) -> Result<(), RowError> {
    Pending::open(path).and_then(|pending| pending.finish(bytes)).map_err(io(path))
}

fn parse(path: &Path, bytes: &[u8], sweep: &Sweep) -> Result<BTreeMap<usize, Row>, RowError> {
    let foreign = |line: usize, reason: &str| RowError::Foreign { path: path.into(), reason: format!("line {line}: {reason}") };
    let mut rows = BTreeMap::new();
    let reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(bytes);
    for (line, record) in reader.into_records().enumerate() {
        let line = line + 1;
        let record = record.map_err(|error| foreign(line, &error.to_string()))?;
        if record.len() != sweep.measures.len() + 2 {
            return Err(foreign(line, "has not the fields of a row of this sweep"));
        }
        let index = record[0].parse().ok().filter(|&index: &usize| index < sweep.len());
        let index = index.ok_or_else(|| foreign(line, "does not begin with the index of a point"))?;
        let number = |text: &str| match text {
            "" => Ok(None),
            _ => text.parse().map(Some).map_err(|_| foreign(line, &format!("{text:?} is not a number"))),
        };
        let measures = record.iter().skip(1).take(sweep.measures.len()).map(number).collect::<Result<_, _>>()?;
        rows.insert(index, Row { index, measures, status: record[record.len() - 1].to_owned() });
    }
    Ok(rows)
}

/// Gathers the rows of all shards in `folder` and writes `results.csv`, in the grid's order.
///
/// # Errors
/// [`RowError::Incomplete`] if a point is in no shard; nothing is written then.
pub fn merge(folder: &Path, sweep: &Sweep) -> Result<PathBuf, RowError> {
    claim(folder, sweep)?;
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(io(folder))? {
        let path = entry.map_err(io(folder))?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if name.starts_with("rows-") && name.ends_with(".csv") {
            let bytes = std::fs::read(&path).map_err(io(&path))?;
            let whole = bytes.iter().rposition(|&b| b == b'\n').map_or(0, |end| end + 1);
            all.append(&mut parse(&path, &bytes[..whole], sweep)?);
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
        let values = sweep.point(row.index).into_iter().map(ToString::to_string);
        let measures = row.measures.iter().map(|m| m.map_or_else(String::new, |m| format!("{m:?}")));
        writer.write_record(values.chain(measures).chain([row.status.clone()])).map_err(io_of_csv)?;
    }
    let bytes = writer.into_inner().map_err(|error| RowError::Io { path: path.clone(), reason: error.to_string() })?;
    replace(&path, &bytes)?;
    Ok(path)
}
