//! The finished rows of a folder, by point: the lines as they stand in the files, so that a million of them take some tens of megabytes.

use std::path::{Path, PathBuf};

use super::journal::Note;
use super::rows::{Line, Row, RowError, io, read_line};
use crate::files;

/// Finished rows of some files of a folder.
#[derive(Debug)]
pub struct Finished {
    files: Vec<Content>,
    /// Where the row of each point is.
    places: Vec<Option<Place>>,
    found: usize,
    failed: usize,
    warnings: Vec<String>,
}

/// A file of rows.
#[derive(Debug)]
pub(super) struct Content {
    /// Where it is.
    pub(super) path: PathBuf,
    bytes: Vec<u8>,
    /// Who worked on it, in order.
    pub(super) notes: Vec<Note>,
    /// Number of its rows.
    pub(super) rows: usize,
    /// Number of rows of its last process.
    pub(super) since_begin: usize,
}

/// The cells of a row in a file: measures and status.
#[derive(Debug, Clone, Copy)]
struct Place {
    file: u32,
    start: usize,
    end: usize,
}

/// Whether a file of this name holds rows.
fn is_rows_file(name: &str) -> bool {
    name.starts_with("rows-") && name.ends_with(".csv")
}

/// The paths of all files of rows in a folder, sorted.
pub(super) fn rows_files(folder: &Path) -> Result<Vec<PathBuf>, RowError> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io(folder))? {
        let path = entry.map_err(io(folder))?.path();
        if path.file_name().and_then(|name| name.to_str()).is_some_and(is_rows_file) {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

impl Finished {
    /// Reads files of rows of a sweep with so many points. A line that a kill or the file system damaged is left out with a warning, so that its point is computed again.
    ///
    /// # Errors
    /// [`RowError`] if a file cannot be read or is none of this sweep's, or if one point has two different results.
    pub fn read(points: usize, paths: impl IntoIterator<Item = PathBuf>) -> Result<Self, RowError> {
        let mut finished = Self { files: Vec::new(), places: vec![None; points], found: 0, failed: 0, warnings: Vec::new() };
        for path in paths {
            let bytes = files::read(&path).map_err(io(&path))?;
            finished.add(path, bytes)?;
        }
        Ok(finished)
    }

    fn add(&mut self, path: PathBuf, bytes: Vec<u8>) -> Result<(), RowError> {
        let file = self.files.len() as u32;
        let (mut notes, mut damaged, mut since_begin) = (Vec::new(), Vec::new(), 0);
        let mut start = 0;
        let mut added = Vec::new();
        for (number, line) in bytes.split_inclusive(|&byte| byte == b'\n').enumerate() {
            let begin = start;
            start += line.len();
            // A line without its end is being written, or was cut off.
            let Some(line) = line.strip_suffix(b"\n") else { break };
            match read_line(line) {
                Line::Row { index, cells } if index < self.places.len() => {
                    since_begin += 1;
                    added.push((index, Place { file, start: begin + cells.start, end: begin + cells.end }));
                }
                Line::Row { .. } => {
                    let reason = format!("line {}: does not begin with the index of a point", number + 1);
                    return Err(RowError::Foreign { path, reason });
                }
                Line::Note(note) => {
                    if matches!(note, Note::Begin(_)) {
                        since_begin = 0;
                    }
                    notes.push(note);
                }
                Line::Damaged => damaged.push(number + 1),
            }
        }
        if let Some(line) = damaged.first() {
            if added.is_empty() && notes.is_empty() {
                return Err(RowError::Foreign { path, reason: format!("line {line}: is not a row of a sweep") });
            }
            let (lines, them) = if damaged.len() == 1 { ("1 line is", "its point") } else { ("lines are", "their points") };
            let count = if damaged.len() == 1 { String::new() } else { format!("{} ", damaged.len()) };
            self.warnings.push(format!(
                "{}: {count}{lines} damaged, the first of them line {line}: {them} counted as missing",
                path.display()
            ));
        }
        self.files.push(Content { path, bytes, notes, rows: added.len(), since_begin });
        for (index, place) in added {
            self.place(index, place)?;
        }
        Ok(())
    }

    fn place(&mut self, index: usize, place: Place) -> Result<(), RowError> {
        let Some(there) = self.places[index] else {
            self.failed += usize::from(!is_ok(self.cells_at(place)));
            self.found += 1;
            self.places[index] = Some(place);
            return Ok(());
        };
        if self.cells_at(there) == self.cells_at(place) {
            return Ok(());
        }
        Err(RowError::Contradiction {
            point: index,
            first: self.files[there.file as usize].path.clone(),
            second: self.files[place.file as usize].path.clone(),
        })
    }

    fn cells_at(&self, place: Place) -> &[u8] {
        &self.files[place.file as usize].bytes[place.start..place.end]
    }

    /// Measures and status of a point as they stand in its line.
    pub(super) fn cells(&self, index: usize) -> Option<&[u8]> {
        self.places.get(index).copied().flatten().map(|place| self.cells_at(place))
    }

    /// True if the point is computed.
    pub fn has(&self, index: usize) -> bool {
        self.places.get(index).is_some_and(Option::is_some)
    }

    /// True if the point is computed and its status is not `ok`.
    pub(super) fn is_failed(&self, index: usize) -> bool {
        self.cells(index).is_some_and(|cells| !is_ok(cells))
    }

    /// The row of a point.
    pub fn row(&self, index: usize) -> Option<Row> {
        Row::of_cells(index, self.cells(index)?)
    }

    /// Number of computed points.
    pub fn found(&self) -> usize {
        self.found
    }

    /// Number of those whose status is not `ok`.
    pub fn failed(&self) -> usize {
        self.failed
    }

    /// Length of the files.
    pub(super) fn bytes(&self) -> usize {
        self.files.iter().map(|file| file.bytes.len()).sum()
    }

    /// What is damaged.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The files.
    pub(super) fn files(&self) -> &[Content] {
        &self.files
    }
}

/// True if cells end with the status `ok`.
fn is_ok(cells: &[u8]) -> bool {
    cells == b"ok" || cells.ends_with(b",ok")
}
