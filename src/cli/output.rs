//! Output files: checked before the work starts, written atomically.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::Failure;
use crate::date::now;
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
