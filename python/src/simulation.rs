//! A robot that is stepped from Python.

use std::sync::{Mutex, MutexGuard, TryLockError};

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyRuntimeError;
use pyo3::intern;
use pyo3::prelude::*;
use sfers::engine::JointState;
use sfers::experiment::{self, SavedState};
use sfers::simulation;

use crate::error;

/// Steps between two looks for Ctrl-C: some ms at most.
const LOOK_STEPS: u64 = 1024;

/// A robot with its drive, between two time steps.
#[pyclass(frozen, module = "sfers_rs._native")]
pub struct Simulation {
    inner: Mutex<simulation::Simulation>,
}

/// What each thread finds that comes while another one steps.
fn busy() -> PyErr {
    PyRuntimeError::new_err("this Simulation is in use by another thread; give every thread its own")
}

/// Voltages as an array of doubles: as they are, or whatever numpy makes one of.
fn numbers<'py>(voltages: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    if let Ok(array) = voltages.extract() {
        return Ok(array);
    }
    let py = voltages.py();
    let made = py.import(intern!(py, "numpy"))?.call_method1(intern!(py, "asarray"), (voltages, intern!(py, "float64")));
    let made = made.map_err(|e| error::value(format!("voltages: no array of numbers: {e}")))?;
    made.extract().map_err(|_| error::value("voltages: no array of numbers"))
}

impl Simulation {
    pub fn of(experiment: experiment::Experiment) -> PyResult<Self> {
        let inner = simulation::Simulation::of(experiment).map_err(|e| error::of_simulation(&e))?;
        Ok(Self { inner: Mutex::new(inner) })
    }

    fn lock(&self) -> PyResult<MutexGuard<'_, simulation::Simulation>> {
        match self.inner.try_lock() {
            Ok(guard) => Ok(guard),
            Err(TryLockError::WouldBlock) => Err(busy()),
            Err(TryLockError::Poisoned(_)) => Err(PyRuntimeError::new_err("this Simulation failed within a step; make another")),
        }
    }

    /// A joint quantity as an array of shape (joints,).
    fn of_joints<'py>(&self, py: Python<'py>, pick: impl Fn(&JointState) -> &[f64]) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let mut simulation = self.lock()?;
        let joints = simulation.joints().map_err(|e| error::of_simulation(&e))?;
        Ok(PyArray1::from_slice(py, pick(joints)))
    }

    /// A quantity of the nodes as an array of shape (nodes, 2).
    fn of_nodes<'py>(
        &self,
        py: Python<'py>,
        pick: impl Fn(&simulation::Node) -> [f64; 2],
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let mut simulation = self.lock()?;
        let nodes = simulation.nodes().map_err(|e| error::of_simulation(&e))?;
        let flat: Vec<f64> = nodes.iter().flat_map(pick).collect();
        PyArray1::from_vec(py, flat).reshape([nodes.len(), 2])
    }
}

#[pymethods]
impl Simulation {
    /// Takes `n` steps. `voltages` (V): none follows the drive or what was set before, shape (actuators,) is held, shape (n, actuators) has a row for each step.
    #[pyo3(signature = (n=1, voltages=None))]
    fn step(&self, py: Python<'_>, n: i64, voltages: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let voltages = voltages.map(numbers).transpose()?;
        let n = u64::try_from(n).map_err(|_| error::value(format!("n: {n} steps, but there are only steps forward")))?;
        let mut simulation = self.lock()?;
        let actuators = simulation.robot().actuators;
        let mut rows = None;
        if let Some(voltages) = &voltages {
            let values: Vec<f64> = voltages.as_array().iter().copied().collect();
            match *voltages.shape() {
                [columns] if columns == actuators => {
                    simulation.set_voltages(&values).map_err(|e| error::of_simulation(&e))?;
                }
                [count, columns] if columns == actuators && count as u64 == n => rows = Some(values),
                _ => {
                    return Err(error::value(format!(
                        "voltages: shape {:?}, but a robot of {actuators} actuators takes ({actuators},) or ({n}, {actuators})",
                        voltages.shape()
                    )));
                }
            }
        }
        let simulation = &mut *simulation;
        py.detach(|| {
            for at in 0..n {
                if at % LOOK_STEPS == LOOK_STEPS - 1 {
                    Python::attach(|py| py.check_signals())?;
                }
                if let Some(rows) = &rows {
                    let row = actuators * at as usize;
                    let set = simulation.set_voltages(&rows[row..row + actuators]);
                    set.map_err(|e| error::of_simulation(&e))?;
                }
                simulation.step().map_err(|e| error::of_simulation(&e))?;
            }
            Ok(())
        })
    }

    /// Gives the actuators the drive's voltages again.
    fn follow_drive(&self) -> PyResult<()> {
        self.lock()?.follow_drive().map_err(|e| error::of_simulation(&e))
    }

    #[getter]
    fn time_s(&self) -> PyResult<f64> {
        Ok(self.lock()?.time())
    }

    #[getter]
    fn steps(&self) -> PyResult<u64> {
        Ok(self.lock()?.steps())
    }

    #[getter]
    fn actuators(&self) -> PyResult<usize> {
        Ok(self.lock()?.robot().actuators)
    }

    #[getter]
    fn joint_angles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.of_joints(py, |joints| &joints.angles)
    }

    #[getter]
    fn joint_rates<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.of_joints(py, |joints| &joints.rates)
    }

    #[getter]
    fn joint_torques<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.of_joints(py, |joints| &joints.torques)
    }

    #[getter]
    fn joint_voltages<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.of_joints(py, |joints| &joints.motor_voltages)
    }

    #[getter]
    fn nodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.of_nodes(py, |node| node.position)
    }

    #[getter]
    fn node_velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.of_nodes(py, |node| node.velocity)
    }

    /// Rows of link, x, z (cm), force along x and z (dyn) of the last step's contacts, shape (contacts, 5).
    #[getter]
    fn contacts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let mut simulation = self.lock()?;
        let contacts = simulation.contacts().map_err(|e| error::of_simulation(&e))?;
        let row = |c: &sfers::engine::Contact| [c.link as f64, c.position[0], c.position[1], c.force[0], c.force[1]];
        PyArray1::from_vec(py, contacts.iter().flat_map(row).collect()).reshape([contacts.len(), 5])
    }

    /// The state as JSON.
    fn save(&self) -> PyResult<String> {
        let state = self.lock()?.save().map_err(|e| error::of_simulation(&e))?;
        serde_json::to_string(&state).map_err(|e| error::value(e.to_string()))
    }

    /// Goes on from a state of the same robot, engine and time step.
    fn restore(&self, state: &str) -> PyResult<()> {
        let state: SavedState =
            serde_json::from_str(state).map_err(|e| error::value(format!("state: not a saved state: {e}")))?;
        self.lock()?.restore(&state).map_err(|e| error::of_simulation(&e))
    }
}
