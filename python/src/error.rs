//! Errors of the library as exceptions of `sfers_rs.errors`.

use pyo3::prelude::*;
use sfers::diagnose::DiagnoseError;
use sfers::diagnose::dataset::DataError;
use sfers::engine::EngineError;
use sfers::experiment::ConfigError;
use sfers::recording::RecordingError;
use sfers::simulation::SimulationError;
use sfers::sweep::RowError;

/// An exception of `sfers_rs.errors` with its message and attributes; what stops it from being made, if that fails.
fn exception(class: &str, message: &str, attributes: &[(&str, Option<String>)]) -> PyErr {
    let made = Python::attach(|py| -> PyResult<PyErr> {
        let value = py.import("sfers_rs.errors")?.getattr(class)?.call1((message,))?;
        for (name, attribute) in attributes {
            value.setattr(*name, attribute)?;
        }
        Ok(PyErr::from_value(value))
    });
    made.unwrap_or_else(|error| error)
}

/// Name of an experiment that is given as tables.
pub const TABLES: &str = "the experiment";

/// The number behind `line ` in a text.
fn line_in(text: &str) -> Option<String> {
    let rest = &text[text.find("line ")? + 5..];
    let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
    (!digits.is_empty()).then_some(digits)
}

/// The key in a message that there is no such key.
fn unknown_key_in(text: &str) -> Option<String> {
    let rest = &text[text.find("there is no key ")? + 16..];
    rest.split_whitespace().next().map(str::to_owned)
}

/// `ExperimentError` with `file`, `line` and `key`.
pub fn of_config(error: &ConfigError) -> PyErr {
    let mut message = error.to_string();
    let (file, key) = match error {
        // A table has no lines.
        ConfigError::Value { place, key, message: wrong } if place.starts_with(TABLES) => {
            message = format!("{key}: {wrong}");
            (String::new(), Some(key.clone()))
        }
        ConfigError::Unreadable { path, .. } | ConfigError::Data { path, .. } => (path.display().to_string(), None),
        ConfigError::Syntax { source_name, message } => (source_name.clone(), unknown_key_in(message)),
        ConfigError::Value { place, key, .. } => {
            (place.split(", line ").next().unwrap_or_default().to_owned(), Some(key.clone()))
        }
        _ => (String::new(), None),
    };
    let line = line_in(message.strip_prefix(&file).unwrap_or(&message));
    let file = (!file.is_empty() && file != TABLES).then_some(file);
    exception("ExperimentError", &message, &[("file", file), ("key", key), ("line", line)])
}

/// `DataError`, or `ExperimentError` where the description is at fault.
pub fn of_data(error: DataError) -> PyErr {
    match error {
        DataError::Description(error) => of_config(&error),
        other => exception("DataError", &other.to_string(), &[]),
    }
}

/// `SimulationError`.
pub fn of_engine(error: &EngineError) -> PyErr {
    of_simulation_message(&error.to_string())
}

/// `ValueError` for what a caller gave, `SimulationError` for what happened.
pub fn of_simulation(error: &SimulationError) -> PyErr {
    match error {
        SimulationError::Engine(error @ EngineError::Voltages { .. }) => value(error.to_string()),
        SimulationError::Engine(error) => of_engine(error),
        other => value(other.to_string()),
    }
}

/// `SimulationError` with a message.
pub fn of_simulation_message(message: &str) -> PyErr {
    exception("SimulationError", message, &[])
}

/// `DataError` of a file that cannot be read or written.
pub fn of_recording(error: &RecordingError) -> PyErr {
    exception("DataError", &error.to_string(), &[])
}

/// `DataError` of a sweep's folder.
pub fn of_rows(error: &RowError) -> PyErr {
    match error {
        RowError::Invalid(error) => of_config(error),
        error => exception("DataError", &error.to_string(), &[]),
    }
}

/// `DiagnosisError`.
pub fn of_diagnosis(error: &DiagnoseError) -> PyErr {
    exception("DiagnosisError", &error.to_string(), &[])
}

/// `ValueError`.
pub fn value(message: impl Into<String>) -> PyErr {
    pyo3::exceptions::PyValueError::new_err(message.into())
}
