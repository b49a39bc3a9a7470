//! Output files: checked before the work starts, written atomically.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use serde_json::{Value, json};

use super::Failure;
use crate::experiment::{EngineKind, Experiment, StepChoice};
use crate::files::{Pending, with_suffix};
use crate::recording::{Recording, csv, npz};

/// File format of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Npz,
    Csv,
}

/// Destination of a recording.
pub struct Output {
    path: PathBuf,
    format: Format,
    /// `None`: standard output.
    files: Option<Files>,
}

/// The result and its manifest.
struct Files {
    result: Pending,
    /// `None` beside a pipe or a device.
    manifest: Option<Pending>,
}

/// The failure of a file that cannot be written.
pub fn unwritable(path: &Path, reason: &dyn std::fmt::Display) -> Failure {
    Failure::Usage(format!("{}: cannot be written: {reason}", path.display()))
}

impl Output {
    /// Opens `path`; `-` is CSV on standard output.
    pub fn open(path: &Path) -> Result<Self, Failure> {
        if path == Path::new("-") {
            return Ok(Self { path: path.into(), format: Format::Csv, files: None });
        }
        let format = match path.extension().and_then(|extension| extension.to_str()) {
            Some("npz") => Format::Npz,
            Some("csv") => Format::Csv,
            _ => return Err(Failure::Usage(format!("{}: the name must end in .npz or .csv", path.display()))),
        };
        let result = pending(path)?;
        let manifest = if result.is_stream() { None } else { Some(pending(&with_suffix(path, ".manifest.json"))?) };
        let files = Files { result, manifest };
        Ok(Self { path: path.into(), format, files: Some(files) })
    }

    /// True if the recording goes to standard output, which then takes nothing else.
    pub fn is_stdout(&self) -> bool {
        self.files.is_none()
    }

    /// The path, if it is not standard output.
    pub fn path(&self) -> Option<&Path> {
        self.files.is_some().then_some(self.path.as_path())
    }

    /// Writes the recording and its manifest.
    pub fn write(self, recording: &Recording, manifest: &Value) -> Result<(), Failure> {
        let mut bytes = Vec::new();
        match self.format {
            Format::Npz => npz::write(recording, &mut bytes, &self.path)?,
            Format::Csv => csv::write(recording, &mut bytes, &self.path)?,
        }
        let Some(Files { result, manifest: manifest_file }) = self.files else {
            return Ok(io::stdout().lock().write_all(&bytes)?);
        };
        finish(result, &bytes)?;
        manifest_file.map_or(Ok(()), |file| finish(file, format!("{manifest:#}\n").as_bytes()))
    }
}

/// Opens a file to be written later.
pub fn pending(path: &Path) -> Result<Pending, Failure> {
    Pending::open(path).map_err(|error| unwritable(path, &error))
}

/// Writes a file that was opened before.
pub fn finish(file: Pending, bytes: &[u8]) -> Result<(), Failure> {
    let path = file.path().to_owned();
    file.finish(bytes).map_err(|error| unwritable(&path, &error))
}

/// Provenance of a result: command line, resolved experiment, versions, wall time (s).
pub fn manifest(experiment: &Experiment, step_choice: Option<&StepChoice>, wall_s: f64, interrupted: bool) -> Value {
    json!({
        "schema": 1,
        "command": std::env::args().collect::<Vec<_>>(),
        "experiment": experiment.config,
        "resolved_cgs": experiment.spec(),
        "step_choice": step_choice,
        "velocities": match experiment.engine {
            EngineKind::Bullet => json!({
                "dataPositionVelocities": "as the reference: of the links' centres of mass, one step late; the left end's is its own",
                "nodes_velocity": "of the nodes themselves at dataTime",
            }),
            EngineKind::Planar => json!({
                "dataPositionVelocities": "of the nodes themselves at dataTime",
                "nodes_velocity": "of the nodes themselves at dataTime",
            }),
        },
        "git_revision": env!("SFERS_GIT_REVISION"),
        "version": env!("CARGO_PKG_VERSION"),
        "bullet": env!("SFERS_BULLET"),
        // Nothing here is random.
        "seed": null,
        "interrupted": interrupted,
        "wall_s": wall_s,
        "finished": now().iso(),
    })
}

/// Date and time in UTC.
#[derive(Debug, Clone, Copy)]
pub struct DateTime {
    /// Time since 1970-01-01 00:00:00 (s).
    seconds: u64,
}

/// The time now.
pub fn now() -> DateTime {
    DateTime { seconds: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |elapsed| elapsed.as_secs()) }
}

impl DateTime {
    /// ISO 8601: `2026-05-01T12:00:00Z`.
    pub fn iso(self) -> String {
        let (year, month, day) = civil(self.seconds / 86400);
        let s = self.seconds;
        format!("{year:04}-{month:02}-{day:02}T{:02}:{:02}:{:02}Z", s / 3600 % 24, s / 60 % 60, s % 60)
    }

    /// `MM_DD_YYYY_HH_MM`, as in the reference's recordings.
    pub fn of_the_reference(self) -> String {
        let (year, month, day) = civil(self.seconds / 86400);
        format!("{month:02}_{day:02}_{year:04}_{:02}_{:02}", self.seconds / 3600 % 24, self.seconds / 60 % 60)
    }
}

/// Year, month and day of a number of days since 1970-01-01.
fn civil(mut days: u64) -> (u64, usize, u64) {
    let leap = |year: u64| year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    let mut year = 1970;
    while days >= 365 + u64::from(leap(year)) {
        days -= 365 + u64::from(leap(year));
        year += 1;
    }
    let lengths = [31, 28 + u64::from(leap(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let mut month = 0;
    while days >= lengths[month] {
        days -= lengths[month];
        month += 1;
    }
    (year, month + 1, days + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_iso_8601_and_in_recordings_as_the_reference_writes_them() {
        let time = DateTime { seconds: 20574 * 86400 + 43_209 };
        assert_eq!(time.iso(), "2026-05-01T12:00:09Z");
        assert_eq!(time.of_the_reference(), "05_01_2026_12_00");
    }

    #[test]
    fn days_become_dates_across_leap_years() {
        assert_eq!(civil(0), (1970, 1, 1));
        assert_eq!(civil(11016), (2000, 2, 29));
        assert_eq!(civil(11017), (2000, 3, 1));
        assert_eq!(civil(20454), (2026, 1, 1));
    }
}
