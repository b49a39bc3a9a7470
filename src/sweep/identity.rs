//! The identity of a sweep, all that determines its results, in `sweep.json` beside its rows.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::journal::PROGRAM;
use super::{RowError, Sweep};
use crate::files::Pending;

/// Key of the list of programs, the only part of an identity that may grow.
const PROGRAMS: &str = "programs";

impl Sweep {
    /// All that determines the results: sweeps of equal identity have equal rows.
    pub fn identity(&self) -> Value {
        let axes: Vec<_> = self.axes.iter().map(|axis| json!({"key": axis.key, "values": axis.values})).collect();
        let settings: Vec<_> = self.source.settings().iter().map(|setting| json!([setting.key, setting.value])).collect();
        json!({
            "schema": 4,
            PROGRAMS: [PROGRAM],
            "experiment": self.source.text(),
            "settings": settings,
            "ensemble": self.is_ensemble,
            "measures": self.measures,
            "vary": axes,
            "files": self.files,
        })
    }

    /// Writes the identity to the folder, or checks the one there.
    ///
    /// # Errors
    /// [`RowError::Foreign`] with the differences; [`RowError::OtherProgram`] if only the program differs.
    pub(super) fn claim(&self, folder: &Path) -> Result<(), RowError> {
        let path = path(folder);
        let Some(found) = read(&path)? else {
            // Shards that start together write the same text.
            return write(&path, &self.identity());
        };
        self.accept(path, &found)
    }

    /// Checks that a folder holds rows of this sweep, by this program.
    ///
    /// # Errors
    /// As [`claim`](Self::claim), and [`RowError::Foreign`] if the folder is none of a sweep.
    pub(super) fn check_identity(&self, folder: &Path) -> Result<(), RowError> {
        let path = path(folder);
        let Some(found) = read(&path)? else {
            return Err(RowError::Foreign { path, reason: "is not there: this is no folder of a sweep".into() });
        };
        self.accept(path, &found)
    }

    /// Accepts an identity of this sweep and this program.
    fn accept(&self, path: PathBuf, found: &Value) -> Result<(), RowError> {
        self.compare(&path, found)?;
        let programs = found[PROGRAMS].as_array().cloned().unwrap_or_default();
        if programs.iter().any(|program| program == PROGRAM) {
            return Ok(());
        }
        let theirs: Vec<_> = programs.iter().map(|program| program.as_str().unwrap_or_default()).collect();
        Err(RowError::OtherProgram { path, theirs: theirs.join(" and "), ours: PROGRAM.into() })
    }

    /// Compares all but the program.
    fn compare(&self, path: &Path, found: &Value) -> Result<(), RowError> {
        let differences = differences(found, &self.identity());
        if differences.is_empty() {
            return Ok(());
        }
        let reason = format!(
            "holds the results of another sweep: {} differ; choose another --out, or remove the folder",
            differences.join(", ")
        );
        Err(RowError::Foreign { path: path.into(), reason })
    }
}

/// Creates a folder for the rows of a sweep, or checks that it belongs to it.
///
/// # Errors
/// [`RowError`] if it cannot be written, or belongs to another sweep or another program.
pub fn claim(folder: &Path, sweep: &Sweep) -> Result<(), RowError> {
    std::fs::create_dir_all(folder).map_err(super::rows::io(folder))?;
    sweep.claim(folder)
}

/// Adds this program to the identity in the folder, so that a sweep of another revision can continue.
///
/// # Errors
/// [`RowError`] if the folder holds another sweep's rows, or its identity cannot be written.
pub fn adopt(folder: &Path, sweep: &Sweep) -> Result<(), RowError> {
    let path = path(folder);
    let Some(mut found) = read(&path)? else { return Ok(()) };
    sweep.compare(&path, &found)?;
    match found[PROGRAMS].as_array_mut() {
        Some(programs) if !programs.iter().any(|program| program == PROGRAM) => programs.push(PROGRAM.into()),
        _ => return Ok(()),
    }
    write(&path, &found)
}

pub(super) fn path(folder: &Path) -> PathBuf {
    folder.join("sweep.json")
}

pub(super) fn read(path: &Path) -> Result<Option<Value>, RowError> {
    match crate::files::read_text(path) {
        Ok(text) => serde_json::from_str(&text).map(Some).map_err(|error| RowError::Foreign {
            path: path.into(),
            reason: format!("is not the identity of a sweep ({error}); choose another --out, or remove the folder"),
        }),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(RowError::Io { path: path.into(), reason: error.to_string() }),
    }
}

fn write(path: &Path, identity: &Value) -> Result<(), RowError> {
    let text = format!("{identity:#}\n");
    Pending::open(path)
        .and_then(|pending| pending.finish(text.as_bytes()))
        .map_err(|error| RowError::Io { path: path.into(), reason: error.to_string() })
}

/// The differences of two identities except for the programs, in words.
fn differences(found: &Value, ours: &Value) -> Vec<String> {
    if found["schema"] != ours["schema"] {
        return vec!["their layouts (it is of another version of the program)".into()];
    }
    let mut list = Vec::new();
    for (key, words) in [("experiment", "the experiment files"), ("settings", "the settings"), ("measures", "the measures")] {
        if found[key] != ours[key] {
            list.push(words.to_owned());
        }
    }
    let axes = |identity: &Value| -> Vec<(String, Value)> {
        let axes = identity["vary"].as_array().cloned().unwrap_or_default();
        axes.into_iter().map(|axis| (axis["key"].as_str().unwrap_or_default().to_owned(), axis["values"].clone())).collect()
    };
    let files = |identity: &Value| -> Vec<(String, Value)> {
        let files = identity["files"].as_object().cloned().unwrap_or_default();
        files.into_iter().collect()
    };
    list.extend(unequal(&axes(found), &axes(ours)).into_iter().map(|key| format!("the values of {key}")));
    list.extend(unequal(&files(found), &files(ours)).into_iter().map(|name| format!("the contents of {name}")));
    if list.is_empty() && found["vary"] != ours["vary"] {
        list.push("the orders of the varied keys".into());
    }
    list
}

/// Names with different values in two lists, or missing in one.
fn unequal(a: &[(String, Value)], b: &[(String, Value)]) -> Vec<String> {
    let names = a.iter().chain(b.iter().filter(|(name, _)| !a.iter().any(|(other, _)| other == name))).map(|(name, _)| name);
    let value =
        |list: &[(String, Value)], name: &str| list.iter().find(|(other, _)| other == name).map(|(_, value)| value.clone());
    names.filter(|name| value(a, name) != value(b, name)).cloned().collect()
}
