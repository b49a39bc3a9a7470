//! Finished rows on disk: one append-only file per shard, so that a killed process loses only the points in work.
//!
//! A line is a row, with its index first and a checksum last, or a note of a process's beginning or end. One call writes one line. A line without its end was
//! cut off by a kill or a full disk; it is removed. A line whose checksum does not fit, as a network file system can leave it, is passed over. The points of both
//! are computed again.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Duration;

use thiserror::Error;

use super::Sweep;
use super::journal::Note;
use crate::experiment::ConfigError;
use crate::files;

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

impl Row {
    /// The line, with its end.
    fn line(&self) -> Result<Vec<u8>, csv::Error> {
        let mut line = csv::Writer::from_writer(Vec::new());
        let measures = self.measures.iter().map(|m| m.map_or_else(String::new, |m| format!("{m:?}")));
        // A row is one line.
        let status = self.status.replace(['\n', '\r'], " ");
        line.write_record(std::iter::once(self.index.to_string()).chain(measures).chain([status]))?;
        let mut line = line.into_inner().map_err(|error| csv::Error::from(error.into_error()))?;
        line.pop();
        let sum = checksum(&line);
        line.extend(format!(",{sum:08x}\n").bytes());
        Ok(line)
    }

    /// A row from its cells, the measures and the status.
    pub(super) fn of_cells(index: usize, cells: &[u8]) -> Option<Self> {
        let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(cells);
        let record = reader.records().next()?.ok()?;
        let (status, measures) = (record.get(record.len() - 1)?, record.iter().take(record.len() - 1));
        let number = |text: &str| if text.is_empty() { Some(None) } else { text.parse().ok().map(Some) };
        Some(Self { index, measures: measures.map(number).collect::<Option<_>>()?, status: status.to_owned() })
    }
}

/// 32 bits of a digest of a line.
fn checksum(line: &[u8]) -> u32 {
    let hash = files::fnv1a(line);
    (hash ^ (hash >> 32)) as u32
}

/// What a line is.
#[derive(Debug, PartialEq)]
pub(super) enum Line {
    /// A row: its point, and where its measures and status stand in the line.
    Row {
        /// Index of the point.
        index: usize,
        /// Range of bytes.
        cells: Range<usize>,
    },
    /// A note.
    Note(Note),
    /// Neither.
    Damaged,
}

/// Reads a line without its end.
pub(super) fn read_line(line: &[u8]) -> Line {
    if line.starts_with(b"#") {
        return Note::parse(line).map_or(Line::Damaged, Line::Note);
    }
    let row = || {
        let first = line.iter().position(|&byte| byte == b',')?;
        let last = line.iter().rposition(|&byte| byte == b',').filter(|&last| last > first)?;
        let text = |range: Range<usize>| std::str::from_utf8(&line[range]).ok();
        let sound = text(last + 1..line.len())? == format!("{:08x}", checksum(&line[..last]));
        let index = text(0..first)?.parse().ok()?;
        sound.then_some(Line::Row { index, cells: first + 1..last })
    };
    row().unwrap_or(Line::Damaged)
}

/// A point of a sweep with its values, for messages.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Index in the grid.
    pub index: usize,
    /// Keys and values.
    pub values: String,
}

impl Point {
    pub(super) fn of(sweep: &Sweep, index: usize) -> Self {
        let named = sweep.axes.iter().zip(sweep.point(index)).map(|(axis, value)| format!("{} = {value}", axis.key));
        Self { index, values: named.collect::<Vec<_>>().join(", ") }
    }
}

impl std::fmt::Display for Point {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "point {} ({})", self.index, self.values)
    }
}

/// Rows that cannot be read, computed or written.
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
    /// A point that is not a valid experiment.
    #[error(transparent)]
    Invalid(#[from] ConfigError),
    /// Two rows of one point differ.
    #[error(
        "point {point} has different results in {} and {}; two machines or programs disagree: remove one of the files and compute its points again",
        first.display(), second.display()
    )]
    Contradiction {
        /// Index of the point.
        point: usize,
        /// One file.
        first: PathBuf,
        /// The other.
        second: PathBuf,
    },
    /// Points are missing.
    #[error("{missing} of {points} points are missing, the first of them {first}; run the shards that hold them")]
    Incomplete {
        /// Number of missing points.
        missing: usize,
        /// Number of points of the sweep.
        points: usize,
        /// The first missing point.
        first: Point,
    },
}

pub(super) fn io(path: &Path) -> impl Fn(std::io::Error) -> RowError + '_ {
    move |error| RowError::Io { path: path.into(), reason: error.to_string() }
}

/// A file of rows, open for appending.
#[derive(Debug)]
pub struct Rows {
    path: PathBuf,
    file: File,
    unlocked: Option<String>,
}

/// How often and how long a lock is waited for: `sfers sweep --status` holds it for moments.
const LOCK_TRIES: u32 = 20;
const LOCK_PAUSE: Duration = Duration::from_millis(50);

impl Rows {
    /// Opens the file of rows `name` in `folder`, creates both if missing, and checks that the folder belongs to this sweep. The file is locked until the
    /// rows are dropped, if the file system has locks.
    ///
    /// # Errors
    /// [`RowError`] if the folder is another sweep's, another process works on the file, or it cannot be read.
    pub fn open(folder: &Path, sweep: &Sweep, name: &str) -> Result<Self, RowError> {
        Self::open_with(folder, sweep, name, File::try_lock)
    }

    fn open_with(
        folder: &Path,
        sweep: &Sweep,
        name: &str,
        lock: impl Fn(&File) -> Result<(), TryLockError>,
    ) -> Result<Self, RowError> {
        std::fs::create_dir_all(folder).map_err(io(folder))?;
        sweep.claim(folder)?;
        let path = folder.join(name);
        if path.metadata().is_ok_and(|there| !there.is_file()) {
            return Err(RowError::Io { path, reason: "is not a regular file".into() });
        }
        let file = OpenOptions::new().read(true).append(true).create(true).open(&path).map_err(io(&path))?;
        let mut locked = lock(&file);
        for _ in 0..LOCK_TRIES {
            if !matches!(locked, Err(TryLockError::WouldBlock)) {
                break;
            }
            std::thread::sleep(LOCK_PAUSE);
            locked = lock(&file);
        }
        let unlocked = match locked {
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
        let mut rows = Self { path, file, unlocked };
        rows.remove_a_partial_line()?;
        Ok(rows)
    }

    /// Cuts the file after its last line end.
    fn remove_a_partial_line(&mut self) -> Result<(), RowError> {
        let mut bytes = Vec::new();
        self.file.read_to_end(&mut bytes).map_err(io(&self.path))?;
        let whole = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
        if whole < bytes.len() {
            self.file.set_len(whole as u64).map_err(io(&self.path))?;
            self.file.seek(SeekFrom::End(0)).map_err(io(&self.path))?;
        }
        Ok(())
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A warning if the file system has no locks.
    pub fn unlocked(&self) -> Option<&str> {
        self.unlocked.as_deref()
    }

    /// Appends a row; a kill of the process cannot undo it.
    ///
    /// # Errors
    /// [`RowError::Io`] if the row cannot be written; earlier rows are unchanged.
    pub fn append(&mut self, row: &Row) -> Result<(), RowError> {
        let line = row.line().map_err(|error| RowError::Io { path: self.path.clone(), reason: error.to_string() })?;
        self.write(&line)
    }

    /// Appends a note.
    pub(super) fn note(&mut self, note: &Note) -> Result<(), RowError> {
        self.write(note.line().as_bytes())
    }

    fn write(&mut self, line: &[u8]) -> Result<(), RowError> {
        let before = self.file.metadata().map_err(io(&self.path))?.len();
        if let Err(error) = self.file.write_all(line) {
            // Removes a partial line.
            let _ = self.file.set_len(before);
            return Err(io(&self.path)(error));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::io::Error;

    use proptest::prelude::*;

    use super::*;
    use crate::sweep::{Finished, merge};

    const TEXT: &str = "experiment = \"preset:cantilever-dc\"\nmeasures = [\"tip_deflection_mm\"]\n[vary]\n\
        \"simulation.engine\" = [\"planar\", \"bullet\"]\n";
    const NAME: &str = "rows-1-of-1.csv";

    fn row(index: usize, value: Option<f64>) -> Row {
        Row { index, measures: vec![value], status: "ok".into() }
    }

    /// ENOTSUP, ENOLCK and ENOSYS of Linux, as Lustre without flock and old network file systems return them.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_system_that_cannot_lock_is_warned_of_and_the_rows_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let sweep = Sweep::from_text("s.toml", TEXT, Path::new("")).unwrap();
        for code in [95, 37, 38] {
            let lock = |_: &File| Err(TryLockError::Error(Error::from_raw_os_error(code)));
            let mut rows = Rows::open_with(folder.path(), &sweep, NAME, lock).unwrap();
            assert!(rows.unlocked().unwrap().contains("cannot lock"), "{code}");
            rows.append(&row(0, Some(1.5))).unwrap();
        }
        let failing = |_: &File| Err(TryLockError::Error(Error::from_raw_os_error(5)));
        assert!(Rows::open_with(folder.path(), &sweep, NAME, failing).is_err(), "an input/output error is no lack of locks");
        let rows = Rows::open(folder.path(), &sweep, NAME).unwrap();
        assert_eq!(rows.unlocked(), None);
        assert_eq!(Finished::read(2, [rows.path().to_owned()]).unwrap().row(0), Some(row(0, Some(1.5))));
    }

    #[test]
    fn words_are_cells_without_quotes() {
        let folder = tempfile::tempdir().unwrap();
        let sweep = Sweep::from_text("s.toml", TEXT, Path::new("")).unwrap();
        let mut rows = Rows::open(folder.path(), &sweep, NAME).unwrap();
        (0..2).for_each(|index| rows.append(&row(index, None)).unwrap());
        let text = std::fs::read_to_string(merge(folder.path(), &sweep, |_| {}).unwrap()).unwrap();
        assert_eq!(text, "simulation.engine,tip_deflection_mm,status\nplanar,,ok\nbullet,,ok\n");
    }

    #[test]
    fn two_results_of_one_point_are_told_and_equal_ones_are_one() {
        let folder = tempfile::tempdir().unwrap();
        let sweep = Sweep::from_text("s.toml", TEXT, Path::new("")).unwrap();
        let paths: Vec<_> = ["rows-1-of-1.csv", "rows-1-of-2.csv"].map(|name| folder.path().join(name)).into();
        for value in [1.5, 1.5, 1.6] {
            for (path, value) in paths.iter().zip([1.5, value]) {
                Rows::open(folder.path(), &sweep, path.file_name().unwrap().to_str().unwrap())
                    .unwrap()
                    .append(&row(0, Some(value)))
                    .unwrap();
            }
            match Finished::read(2, paths.clone()) {
                Ok(finished) => assert!(value == 1.5 && finished.found() == 1),
                Err(error) => assert!(value != 1.5 && error.to_string().contains("point 0 has different results"), "{error}"),
            }
        }
    }

    /// As a killed client of a network file system leaves a file: a hole of zeros, and a line that another one's rest follows.
    #[test]
    fn damaged_lines_are_told_and_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(NAME);
        let line = |index, value| row(index, Some(value)).line().unwrap();
        let whole = [line(0, 1.0), line(1, 2.0)].concat();
        // A row 3 of which only the 3 was written, and after it row 0: its line alone would be row 30.
        for damage in [&b"\0\0\0\0\0\n"[..], b"3", b"3,1.5\n", b"3,1.5,ok,00000000\n", b"\xff,1,ok,0\n"] {
            std::fs::write(&path, [damage, &line(0, 1.0), &whole].concat()).unwrap();
            let finished = Finished::read(40, [path.clone()]).unwrap();
            assert_eq!((finished.found(), finished.row(1)), (2, Some(row(1, Some(2.0)))));
            assert!(finished.warnings()[0].contains("1 line is damaged, the first of them line 1"), "{:?}", finished.warnings());
            assert!(!finished.has(30));
        }
        std::fs::write(&path, "0,1.0\n").unwrap();
        assert!(Finished::read(2, [path]).unwrap_err().to_string().contains("line 1: is not a row"));
    }

    proptest! {
        #[test]
        fn a_row_is_read_as_it_was_written(index in 0..1_000_000_usize, value in proptest::option::of(any::<f64>()), status in ".{0,40}") {
            prop_assume!(value.is_none_or(|value| !value.is_nan()));
            let row = Row { index, measures: vec![value, None], status };
            let line = row.line().unwrap();
            prop_assert_eq!(line.iter().filter(|&&byte| byte == b'\n').count(), 1);
            let Line::Row { index, cells } = read_line(&line[..line.len() - 1]) else { panic!("{line:?}") };
            let kept = Row { status: row.status.replace(['\n', '\r'], " "), ..row };
            prop_assert_eq!(Row::of_cells(index, &line[cells]), Some(kept));
        }

        #[test]
        fn a_changed_byte_is_noticed(index in 0..1000_usize, value in any::<f64>(), at in 0..10_usize, byte in any::<u8>()) {
            let line = row(index, Some(value)).line().unwrap();
            let mut changed = line[..line.len() - 1].to_vec();
            let at = at % changed.len();
            prop_assume!(changed[at] != byte && byte != b'\n');
            changed[at] = byte;
            prop_assert_eq!(read_line(&changed), Line::Damaged);
        }

        #[test]
        fn no_line_is_a_panic(line in proptest::collection::vec(any::<u8>(), 0..60)) {
            read_line(&line);
        }
    }
}
