//! What is read of bodies, in PyBullet's tuples.
// Names are PyBullet's.
#![allow(non_snake_case)]

use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyTuple};
use sfers::bullet::{LinkReading, Pose};

use super::arguments::{integer, integer_list, numbers};
use super::clients::{Client, with};
use super::single::link_frame;
use super::{refuse, refused};

/// A tuple of floats.
fn floats<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyTuple>> {
    PyTuple::new(py, values.iter().map(|&value| PyFloat::new(py, value)))
}

/// Number of joints; 0 if there is no such body.
#[pyfunction]
#[pyo3(signature = (bodyUniqueId, physicsClientId=0))]
fn getNumJoints(bodyUniqueId: &Bound<'_, PyAny>, physicsClientId: i32) -> PyResult<usize> {
    let body = integer("bodyUniqueId", bodyUniqueId)?;
    with(physicsClientId, |client| Ok(client.body(body).map_or(0, |body| body.links)))
}

/// Angle, rate and motor torque of a joint.
type JointReading = [f64; 3];

/// All joints of a body; those that are fixed read 0.
fn joints(client: &mut Client, body: i32) -> PyResult<Vec<JointReading>> {
    let found = client.body(body)?;
    let mut values = vec![0.0; 3 * found.links];
    let (angles, rest) = values.split_at_mut(found.links);
    let (rates, impulses) = rest.split_at_mut(found.links);
    client.world.joint_states(found.id, angles, rates).map_err(refused("getJointStates"))?;
    client.world.motor_impulses(found.id, impulses).map_err(refused("getJointStates"))?;
    let reading = |(i, &revolute): (usize, &bool)| {
        if revolute { [angles[i], rates[i], impulses[i] / client.time_step] } else { [0.0; 3] }
    };
    Ok(found.revolute.iter().enumerate().map(reading).collect())
}

fn joint_tuple<'py>(
    py: Python<'py>,
    [angle, rate, torque]: JointReading,
    reaction: &Bound<'py, PyTuple>,
) -> PyResult<Bound<'py, PyTuple>> {
    let float = |value| PyFloat::new(py, value).into_any();
    PyTuple::new(py, [float(angle), float(rate), reaction.clone().into_any(), float(torque)])
}

fn joint_at(found: &[JointReading], body: i32, joint: i32) -> PyResult<JointReading> {
    usize::try_from(joint).ok().and_then(|joint| found.get(joint)).copied().ok_or_else(|| {
        refuse(format!("Joint index out-of-range: jointIndex is {joint}, but body {body} has {} joints", found.len()))
    })
}

/// Angle (rad), rate (rad/s), reaction (6 times 0) and motor torque of a joint.
#[pyfunction]
#[pyo3(signature = (bodyUniqueId, jointIndex, physicsClientId=0))]
fn getJointState<'py>(
    py: Python<'py>,
    bodyUniqueId: &Bound<'py, PyAny>,
    jointIndex: &Bound<'py, PyAny>,
    physicsClientId: i32,
) -> PyResult<Bound<'py, PyTuple>> {
    let (body, joint) = (integer("bodyUniqueId", bodyUniqueId)?, integer("jointIndex", jointIndex)?);
    let found = with(physicsClientId, |client| joints(client, body))?;
    joint_tuple(py, joint_at(&found, body, joint)?, &floats(py, &[0.0; 6])?)
}

/// The same of several joints; None of none, as PyBullet has it.
#[pyfunction]
#[pyo3(signature = (bodyUniqueId, jointIndices, physicsClientId=0))]
fn getJointStates<'py>(
    py: Python<'py>,
    bodyUniqueId: &Bound<'py, PyAny>,
    jointIndices: &Bound<'py, PyAny>,
    physicsClientId: i32,
) -> PyResult<Option<Bound<'py, PyTuple>>> {
    let (body, indices) = (integer("bodyUniqueId", bodyUniqueId)?, integer_list("jointIndices", jointIndices)?);
    let found = with(physicsClientId, |client| joints(client, body))?;
    // One tuple of zeros serves all: nobody can change it.
    let reaction = floats(py, &[0.0; 6])?;
    let states = indices.iter().map(|&joint| joint_tuple(py, joint_at(&found, body, joint)?, &reaction));
    let states = states.collect::<PyResult<Vec<_>>>()?;
    if states.is_empty() { Ok(None) } else { PyTuple::new(py, states).map(Some) }
}

fn links(client: &mut Client, body: i32, with_velocities: bool) -> PyResult<Vec<LinkReading>> {
    let id = client.body(body)?.id;
    let mut readings = Vec::new();
    client.world.link_readings(id, with_velocities, &mut readings).map_err(refused("getLinkStates"))?;
    Ok(readings)
}

fn link_tuple<'py>(py: Python<'py>, link: &LinkReading, with_velocities: bool) -> PyResult<Bound<'py, PyTuple>> {
    let frame = link_frame(&link.inertial, &link.local);
    let pose = |Pose { position, orientation }: &Pose| Ok::<_, PyErr>([floats(py, position)?, floats(py, orientation)?]);
    let mut values = Vec::with_capacity(8);
    values.extend(pose(&link.inertial)?);
    values.extend(pose(&link.local)?);
    values.extend(pose(&frame)?);
    if with_velocities {
        values.extend([floats(py, &link.velocity)?, floats(py, &link.angular_velocity)?]);
    }
    PyTuple::new(py, values)
}

/// Whether velocities are asked for; refuses what this drop-in does not have.
fn flags(velocity: Option<&Bound<'_, PyAny>>, kinematics: Option<&Bound<'_, PyAny>>) -> PyResult<bool> {
    let flag =
        |name, value: Option<&Bound<'_, PyAny>>| value.map_or(Ok(false), |value| Ok::<_, PyErr>(integer(name, value)? != 0));
    if flag("computeForwardKinematics", kinematics)? {
        return Err(refuse("computeForwardKinematics: this drop-in reads links as the last step left them, with 0 only"));
    }
    flag("computeLinkVelocity", velocity)
}

fn unless_negative(link: i32) -> PyResult<usize> {
    usize::try_from(link).map_err(|_| refuse(format!("getLinkState failed; invalid linkIndex: linkIndex is {link}")))
}

/// Poses of a link: centre of mass, the same in the link's frame, and the link's frame; with computeLinkVelocity its velocities. None for an
/// index beyond the last link.
#[pyfunction]
#[pyo3(signature = (bodyUniqueId, linkIndex, computeLinkVelocity=None, computeForwardKinematics=None, physicsClientId=0))]
fn getLinkState<'py>(
    py: Python<'py>,
    bodyUniqueId: &Bound<'py, PyAny>,
    linkIndex: &Bound<'py, PyAny>,
    computeLinkVelocity: Option<&Bound<'py, PyAny>>,
    computeForwardKinematics: Option<&Bound<'py, PyAny>>,
    physicsClientId: i32,
) -> PyResult<Option<Bound<'py, PyTuple>>> {
    let body = integer("bodyUniqueId", bodyUniqueId)?;
    let link = unless_negative(integer("linkIndex", linkIndex)?)?;
    let with_velocities = flags(computeLinkVelocity, computeForwardKinematics)?;
    let found = with(physicsClientId, |client| links(client, body, with_velocities))?;
    found.get(link).map(|link| link_tuple(py, link, with_velocities)).transpose()
}

/// The same of several links; -1.0 in place of one beyond the last.
#[pyfunction]
#[pyo3(signature = (bodyUniqueId, linkIndices, computeLinkVelocity=None, computeForwardKinematics=None, physicsClientId=0))]
fn getLinkStates<'py>(
    py: Python<'py>,
    bodyUniqueId: &Bound<'py, PyAny>,
    linkIndices: &Bound<'py, PyAny>,
    computeLinkVelocity: Option<&Bound<'py, PyAny>>,
    computeForwardKinematics: Option<&Bound<'py, PyAny>>,
    physicsClientId: i32,
) -> PyResult<Bound<'py, PyTuple>> {
    let (body, indices) = (integer("bodyUniqueId", bodyUniqueId)?, integer_list("linkIndices", linkIndices)?);
    let with_velocities = flags(computeLinkVelocity, computeForwardKinematics)?;
    let found = with(physicsClientId, |client| links(client, body, with_velocities))?;
    let state = |&index: &i32| match found.get(unless_negative(index)?) {
        Some(link) => Ok(link_tuple(py, link, with_velocities)?.into_any()),
        None => Ok(PyFloat::new(py, -1.0).into_any()),
    };
    PyTuple::new(py, indices.iter().map(state).collect::<PyResult<Vec<_>>>()?)
}

/// Centre of mass and orientation of the base.
#[pyfunction]
#[pyo3(signature = (bodyUniqueId, physicsClientId=0))]
fn getBasePositionAndOrientation<'py>(
    py: Python<'py>,
    bodyUniqueId: &Bound<'py, PyAny>,
    physicsClientId: i32,
) -> PyResult<Bound<'py, PyTuple>> {
    let body = integer("bodyUniqueId", bodyUniqueId)?;
    let base = with(physicsClientId, |client| {
        let id = client.body(body)?.id;
        client.world.base_reading(id).map_err(refused("getBasePositionAndOrientation"))
    })?;
    PyTuple::new(py, [floats(py, &base.position)?, floats(py, &base.orientation)?])
}

/// Velocity and angular velocity of the base.
#[pyfunction]
#[pyo3(signature = (bodyUniqueId, physicsClientId=0))]
fn getBaseVelocity<'py>(
    py: Python<'py>,
    bodyUniqueId: &Bound<'py, PyAny>,
    physicsClientId: i32,
) -> PyResult<Bound<'py, PyTuple>> {
    let body = integer("bodyUniqueId", bodyUniqueId)?;
    let base = with(physicsClientId, |client| {
        let id = client.body(body)?.id;
        client.world.base_reading(id).map_err(refused("getBaseVelocity"))
    })?;
    PyTuple::new(py, [floats(py, &base.velocity)?, floats(py, &base.angular_velocity)?])
}

/// Roll, pitch and yaw (rad) of a quaternion, as in URDF. Needs no client.
#[pyfunction]
#[pyo3(signature = (quaternion, physicsClientId=0))]
fn getEulerFromQuaternion<'py>(
    py: Python<'py>,
    quaternion: &Bound<'py, PyAny>,
    physicsClientId: i32,
) -> PyResult<Bound<'py, PyTuple>> {
    let _ = physicsClientId;
    floats(py, &euler(numbers("quaternion", quaternion)?))
}

/// The angles by PyBullet's operations; next to a pitch of a quarter turn the roll is taken for 0.
fn euler([x, y, z, w]: [f64; 4]) -> [f64; 3] {
    const POLE: f64 = 0.99999;
    const QUARTER: f64 = std::f64::consts::FRAC_PI_2;
    let sine = -2.0 * (x * z - w * y);
    if sine <= -POLE {
        return [0.0, -QUARTER, 2.0 * x.atan2(-y)];
    }
    if sine >= POLE {
        return [0.0, QUARTER, 2.0 * (-x).atan2(y)];
    }
    let (xx, yy, zz, ww) = (x * x, y * y, z * z, w * w);
    [(2.0 * (y * z + w * x)).atan2(ww - xx - yy + zz), sine.asin(), (2.0 * (x * y + w * z)).atan2(ww + xx - yy - zz)]
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(getNumJoints, module)?)?;
    module.add_function(wrap_pyfunction!(getJointState, module)?)?;
    module.add_function(wrap_pyfunction!(getJointStates, module)?)?;
    module.add_function(wrap_pyfunction!(getLinkState, module)?)?;
    module.add_function(wrap_pyfunction!(getLinkStates, module)?)?;
    module.add_function(wrap_pyfunction!(getBasePositionAndOrientation, module)?)?;
    module.add_function(wrap_pyfunction!(getBaseVelocity, module)?)?;
    module.add_function(wrap_pyfunction!(getEulerFromQuaternion, module)?)
}
