//! Recordings as numpy arrays, files and pictures.

use std::path::Path;

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use sfers::experiment::{Experiment, Run};
use sfers::recording::{self, csv, npz};
use sfers::view::{self, Kind};

use crate::error;

/// A recording with what is known of its run.
#[pyclass(frozen, module = "sfers_rs._native")]
pub struct Recording {
    inner: recording::Recording,
    name: String,
    /// Names and values; none of a run with trouble but the energy error.
    measures: Vec<(String, f64)>,
    /// What makes its measures worthless, and what is to be known of them.
    trouble: Vec<String>,
    warnings: Vec<String>,
}

impl Recording {
    pub fn of_run(run: Run, experiment: &Experiment, name: String) -> Self {
        let trouble = run.trouble(experiment);
        let keep = |(name, _): &(String, f64)| trouble.is_empty() || name == "energy_error";
        let measures = run.measures.named().into_iter().filter(keep).collect();
        Self { warnings: run.warnings(experiment), measures, trouble, name, inner: run.recording }
    }
}

#[pymethods]
impl Recording {
    /// From the bytes of an NPZ file, with what is known of its run.
    #[staticmethod]
    #[pyo3(signature = (bytes, name, measures=Vec::new(), trouble=Vec::new(), warnings=Vec::new()))]
    fn from_npz(
        bytes: &[u8],
        name: String,
        measures: Vec<(String, f64)>,
        trouble: Vec<String>,
        warnings: Vec<String>,
    ) -> PyResult<Self> {
        let inner = npz::read(bytes, Path::new(&name)).map_err(|e| error::of_recording(&e))?;
        Ok(Self { inner, name, measures, trouble, warnings })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    #[getter]
    fn measures(&self) -> Vec<(String, f64)> {
        self.measures.clone()
    }

    #[getter]
    fn trouble(&self) -> Vec<String> {
        self.trouble.clone()
    }

    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// The arrays and numbers by the keys of the NPZ file.
    fn arrays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (r, meta) = (&self.inner, &self.inner.meta);
        let (t, j) = (r.len(), r.joints());
        let all = PyDict::new(py);
        let add = |key: &str, values: &[f64], shape: &[usize]| {
            all.set_item(key, PyArray1::from_slice(py, values).reshape(shape.to_vec())?)
        };
        add("dataTime", &r.time, &[t])?;
        add("dataTheta", &r.angles, &[t, j])?;
        add("dataAngularVelocities", &r.rates, &[t, j])?;
        add("dataTor", &r.torques, &[t, j])?;
        add("dataMotorVoltages", &r.motor_voltages, &[t, j])?;
        add("dataPositions", &r.positions, &[t, j + 2, 3])?;
        add("dataPositionVelocities", &r.velocities, &[t, j + 2, 3])?;
        if !r.node_velocities.is_empty() {
            add("nodes_velocity", &r.node_velocities, &[t, j + 2, 3])?;
        }
        all.set_item("timeStep", meta.time_step)?;
        all.set_item("actuatorLength", meta.actuator_length)?;
        all.set_item("drivenFrequency", meta.driven_frequency)?;
        all.set_item("dampingEta", meta.damping_eta)?;
        all.set_item("simCycles", meta.steps)?;
        all.set_item("recordStepInterval", meta.record_every)?;
        all.set_item("N", meta.actuators)?;
        all.set_item("m", meta.motors_per_actuator)?;
        if let Some(ground) = &meta.ground {
            all.set_item("frictionLow", ground.friction_low)?;
            all.set_item("frictionHigh", ground.friction_high)?;
            all.set_item("period", ground.period)?;
        }
        Ok(all)
    }

    /// An NPZ file with the reference's keys.
    fn npz<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let mut bytes = Vec::new();
        npz::write(&self.inner, &mut bytes, Path::new(&self.name)).map_err(|e| error::of_recording(&e))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// A CSV file with units in the names of its columns.
    fn csv(&self) -> PyResult<String> {
        let mut bytes = Vec::new();
        csv::write(&self.inner, &mut bytes, Path::new(&self.name)).map_err(|e| error::of_recording(&e))?;
        String::from_utf8(bytes).map_err(|e| error::value(e.to_string()))
    }

    /// A figure of a kind (traces, shapes, spectrum) as SVG.
    fn svg(&self, kind: &str) -> PyResult<String> {
        let kind = match kind {
            "traces" => Kind::Traces,
            "shapes" => Kind::Shapes,
            "spectrum" => Kind::Spectrum,
            other => return Err(error::value(format!("kind: {other:?} is none of traces, shapes, spectrum"))),
        };
        if self.inner.is_empty() {
            return Err(error::value("the recording holds no records"));
        }
        Ok(kind.titled(&self.name, &self.inner).svg())
    }

    /// The player as an HTML page.
    fn player(&self) -> PyResult<String> {
        if self.inner.is_empty() {
            return Err(error::value("the recording holds no records"));
        }
        Ok(view::player(&self.name, &self.inner, None))
    }
}

/// An SVG figure as PNG or PDF.
#[pyfunction]
#[pyo3(signature = (svg, kind, dpi=300.0))]
pub fn drawn<'py>(py: Python<'py>, svg: &str, kind: &str, dpi: f64) -> PyResult<Bound<'py, PyBytes>> {
    let bytes = match kind {
        "png" if (30.0..=1200.0).contains(&dpi) => view::png(svg, dpi),
        "png" => return Err(error::value(format!("dpi: {dpi} is not between 30 and 1200"))),
        "pdf" => view::pdf(svg),
        other => return Err(error::value(format!("{other:?} is none of svg, png, pdf"))),
    };
    Ok(PyBytes::new(py, &bytes.map_err(|e| error::value(e.to_string()))?))
}
