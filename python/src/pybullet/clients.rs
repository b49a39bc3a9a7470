//! Clients: each has a world of its own.
// Names are PyBullet's.
#![allow(non_snake_case)]

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use sfers::bullet::{BodyId, SolverSettings, TreeBox, World};

use super::arguments::{integer, number, numbers, positive};
use super::{refuse, refused};

/// PyBullet's number of a connection in this process.
pub const DIRECT: i32 = 2;
/// PyBullet's number of a connection to another process, of which there is none here.
pub const SHARED_MEMORY: i32 = 3;

/// PyBullet's largest number of clients at a time.
const MOST_CLIENTS: usize = 1024;
/// PyBullet's time step until another is set (s).
const TIME_STEP: f64 = 1.0 / 240.0;

/// One body and what is read of it often.
pub struct Body {
    pub id: BodyId,
    pub links: usize,
    pub revolute: Vec<bool>,
}

/// A world with what PyBullet keeps beside it.
pub struct Client {
    pub world: World,
    pub time_step: f64,
    pub shapes: Vec<TreeBox>,
    pub bodies: Vec<Body>,
    pub constraints: i32,
    pub search_path: Option<PathBuf>,
}

impl Client {
    fn new() -> PyResult<Self> {
        Ok(Self {
            world: empty_world()?,
            time_step: TIME_STEP,
            shapes: Vec::new(),
            bodies: Vec::new(),
            constraints: 0,
            search_path: None,
        })
    }

    /// The body of an id, or the refusal that PyBullet gives.
    pub fn body(&self, id: i32) -> PyResult<&Body> {
        usize::try_from(id)
            .ok()
            .and_then(|index| self.bodies.get(index))
            .ok_or_else(|| refuse(format!("bodyUniqueId is {id}, but there is no such body")))
    }
}

fn empty_world() -> PyResult<World> {
    World::new(&SolverSettings::pybullet(0.0)).map_err(refused("connect"))
}

static CLIENTS: Mutex<Vec<Option<Client>>> = Mutex::new(Vec::new());

/// The clients by id. The lock is never held while Python objects are made, which may collect garbage and with it a client, so
/// that it is free in every call and after every fork.
fn clients() -> MutexGuard<'static, Vec<Option<Client>>> {
    CLIENTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Calls `work` with the client of an id.
pub fn with<T>(id: i32, work: impl FnOnce(&mut Client) -> PyResult<T>) -> PyResult<T> {
    let mut clients = clients();
    match usize::try_from(id).ok().and_then(|index| clients.get_mut(index)).and_then(Option::as_mut) {
        Some(client) => work(client),
        None => Err(refuse(format!("Not connected to physics server (physicsClientId is {id})."))),
    }
}

/// Makes an empty world of its own and returns its id; -1 for a server in another process, of which there is none.
#[pyfunction]
#[pyo3(signature = (method, key=None, options=None, **kwargs))]
fn connect(
    method: &Bound<'_, PyAny>,
    key: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyAny>>,
    kwargs: Option<&Bound<'_, PyAny>>,
) -> PyResult<i32> {
    let _ = (key, options, kwargs);
    match integer("method", method)? {
        DIRECT => {}
        SHARED_MEMORY => return Ok(-1),
        other => return Err(refuse(format!("method is {other}, but this drop-in connects by DIRECT only"))),
    }
    let client = Client::new()?;
    let mut clients = clients();
    let free = clients.iter().position(Option::is_none).unwrap_or(clients.len());
    if free == MOST_CLIENTS {
        return Err(refuse(format!("there are {MOST_CLIENTS} clients already: disconnect one first")));
    }
    if free == clients.len() {
        clients.push(None);
    }
    clients[free] = Some(client);
    Ok(i32::try_from(free).unwrap_or(-1))
}

/// Ends a client; its id is used again.
#[pyfunction]
#[pyo3(signature = (physicsClientId=0))]
fn disconnect(physicsClientId: i32) -> PyResult<()> {
    with(physicsClientId, |_| Ok(()))?;
    let gone = clients()[physicsClientId.unsigned_abs() as usize].take();
    drop(gone);
    Ok(())
}

/// Empties the world. The time step stays.
#[pyfunction]
#[pyo3(signature = (flags=0, physicsClientId=0))]
fn resetSimulation(flags: i32, physicsClientId: i32) -> PyResult<()> {
    if flags != 0 {
        return Err(refuse(format!("flags is {flags}, but this drop-in has rigid bodies only, with flags 0")));
    }
    with(physicsClientId, |client| {
        let fresh = Client::new()?;
        let (time_step, search_path) = (client.time_step, client.search_path.take());
        *client = Client { time_step, search_path, ..fresh };
        Ok(())
    })
}

/// Sets the time of a step (s).
#[pyfunction]
#[pyo3(signature = (timeStep, physicsClientId=0))]
fn setTimeStep(timeStep: &Bound<'_, PyAny>, physicsClientId: i32) -> PyResult<()> {
    let time_step = positive("timeStep", timeStep)?;
    if time_step < 1e-15 {
        return Err(refuse(format!("timeStep is {time_step} s, which Bullet takes for no step at all")));
    }
    with(physicsClientId, |client| {
        client.time_step = time_step;
        Ok(())
    })
}

/// Sets the acceleration of gravity along x, y and z.
#[pyfunction]
#[pyo3(signature = (gravX, gravY, gravZ, physicsClientId=0))]
fn setGravity(
    gravX: &Bound<'_, PyAny>,
    gravY: &Bound<'_, PyAny>,
    gravZ: &Bound<'_, PyAny>,
    physicsClientId: i32,
) -> PyResult<()> {
    let gravity = [number("gravX", gravX)?, number("gravY", gravY)?, number("gravZ", gravZ)?];
    with(physicsClientId, |client| client.world.set_gravity(gravity).map_err(refused("gravity")))
}

/// Advances by one time step. Torques set before are used up. Returns PyBullet's empty tuple.
#[pyfunction]
#[pyo3(signature = (physicsClientId=0))]
fn stepSimulation(py: Python<'_>, physicsClientId: i32) -> PyResult<Bound<'_, PyTuple>> {
    with(physicsClientId, |client| client.world.step(client.time_step).map_err(refused("stepSimulation")))?;
    Ok(PyTuple::empty(py))
}

/// Accepts a camera; there is no window that would have one.
#[pyfunction]
#[pyo3(signature = (cameraDistance, cameraYaw, cameraPitch, cameraTargetPosition, physicsClientId=0))]
fn resetDebugVisualizerCamera(
    cameraDistance: &Bound<'_, PyAny>,
    cameraYaw: &Bound<'_, PyAny>,
    cameraPitch: &Bound<'_, PyAny>,
    cameraTargetPosition: &Bound<'_, PyAny>,
    physicsClientId: i32,
) -> PyResult<()> {
    number("cameraDistance", cameraDistance)?;
    number("cameraYaw", cameraYaw)?;
    number("cameraPitch", cameraPitch)?;
    numbers::<3>("cameraTargetPosition", cameraTargetPosition)?;
    with(physicsClientId, |_| Ok(()))
}

/// Sets the folder in which loadURDF looks for its file.
#[pyfunction]
#[pyo3(signature = (path, physicsClientId=0))]
fn setAdditionalSearchPath(path: PathBuf, physicsClientId: i32) -> PyResult<()> {
    with(physicsClientId, |client| {
        client.search_path = Some(path);
        Ok(())
    })
}

/// Writes the state of the world to a file of this drop-in's own form.
#[pyfunction]
#[pyo3(signature = (bulletFileName, physicsClientId=0))]
fn saveBullet(bulletFileName: PathBuf, physicsClientId: i32) -> PyResult<()> {
    let saved = with(physicsClientId, |client| client.world.saved().map_err(refused("saveBullet")))?;
    let bytes: Vec<u8> = saved.iter().flat_map(|value| value.to_le_bytes()).collect();
    std::fs::write(&bulletFileName, bytes)
        .map_err(|cause| refuse(format!("Couldn't save .bullet file: bulletFileName is {}: {cause}", bulletFileName.display())))
}

/// Restores what saveBullet wrote, in this client or in another one that was built by the same calls.
#[pyfunction]
#[pyo3(signature = (fileName=None, stateId=-1, physicsClientId=0))]
fn restoreState(fileName: Option<PathBuf>, stateId: i32, physicsClientId: i32) -> PyResult<()> {
    if stateId >= 0 {
        return Err(refuse("stateId: this drop-in restores from a file only, by fileName"));
    }
    let file = fileName.ok_or_else(|| refuse("Couldn't restore state: fileName is missing"))?;
    let told = |cause: String| refuse(format!("Couldn't restore state: fileName is {}: {cause}", file.display()));
    let bytes = std::fs::read(&file).map_err(|cause| told(cause.to_string()))?;
    let (values, rest) = bytes.as_chunks::<8>();
    if !rest.is_empty() {
        return Err(told("it was not written by this drop-in's saveBullet".into()));
    }
    let saved: Vec<f64> = values.iter().map(|value| f64::from_le_bytes(*value)).collect();
    with(physicsClientId, |client| client.world.resume(&saved).map_err(|cause| told(cause.to_string())))
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(connect, module)?)?;
    module.add_function(wrap_pyfunction!(disconnect, module)?)?;
    module.add_function(wrap_pyfunction!(resetSimulation, module)?)?;
    module.add_function(wrap_pyfunction!(setTimeStep, module)?)?;
    module.add_function(wrap_pyfunction!(setGravity, module)?)?;
    module.add_function(wrap_pyfunction!(stepSimulation, module)?)?;
    module.add_function(wrap_pyfunction!(resetDebugVisualizerCamera, module)?)?;
    module.add_function(wrap_pyfunction!(setAdditionalSearchPath, module)?)?;
    module.add_function(wrap_pyfunction!(saveBullet, module)?)?;
    module.add_function(wrap_pyfunction!(restoreState, module)?)
}
