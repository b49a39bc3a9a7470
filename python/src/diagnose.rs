//! `sfers_rs.diagnose`: what a data set is asked.

use std::path::Path;

use pyo3::prelude::*;
use sfers::diagnose::answer::{Answer, answer};
use sfers::diagnose::dataset::Dataset;

use crate::error;
use crate::service::{Call, jobs, serve};

/// Kind of the result, its JSON, and the files beside it: name and text.
pub type Found = (&'static str, String, Vec<(&'static str, String)>);

/// The JSON of a result as in its file.
pub fn json(text: serde_json::Result<String>) -> PyResult<String> {
    text.map(|text| text + "\n").map_err(|error| error::value(error.to_string()))
}

/// The answer to what a data set asks: ("diagnosis" or "identification", JSON, [(file, text)]). `progress` gets tasks in words, on this thread.
#[pyfunction]
#[pyo3(signature = (dataset, command, threads = None, progress = None))]
pub fn diagnose(
    py: Python<'_>,
    dataset: &str,
    command: &str,
    threads: Option<i64>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Found> {
    let threads = jobs(threads)?;
    let dataset = py.detach(|| Dataset::read(Path::new(dataset))).map_err(error::of_data)?;
    let answered = serve(
        py,
        threads,
        |line| answer(&dataset, command, &|task| line.progress(task)),
        |_, call| match (call, &progress) {
            (Call::Progress(task), Some(progress)) => progress.call1((task,)).map(drop),
            _ => Ok(()),
        },
        |_| (),
    )?;
    match answered.map_err(|error| error::of_diagnosis(&error))? {
        Answer::Diagnosed { diagnosis, files, page } => {
            let mut all = vec![("report.html", page)];
            if let Some(files) = files {
                all.extend([("extended.toml", files.experiment), ("drive.csv", files.drive), ("residuals.csv", files.residuals)]);
            }
            Ok(("diagnosis", json(serde_json::to_string_pretty(&diagnosis))?, all))
        }
        Answer::Identified { identification, page } => {
            let json = json(serde_json::to_string_pretty(&identification))?;
            Ok(("identification", json, vec![("report.html", page), ("identified.toml", identification.file)]))
        }
    }
}
