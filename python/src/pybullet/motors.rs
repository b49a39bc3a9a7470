//! Torques and motors of joints.
// Names are PyBullet's.
#![allow(non_snake_case)]

use pyo3::prelude::*;

use super::arguments::{integer, integer_list, not_negative, number, number_list};
use super::clients::{Body, Client, with};
use super::{refuse, refused};

/// PyBullet's number of control by velocity.
pub const VELOCITY_CONTROL: i32 = 0;
/// PyBullet's number of control by torque.
pub const TORQUE_CONTROL: i32 = 1;

/// PyBullet's largest torque of a motor, unless another is given.
const MOTOR_TORQUE: f64 = 100_000.0;
/// Share of a difference of rates that a motor removes in one step, unless another is given.
const MOTOR_GAIN: f64 = 1.0;

/// What a motor does.
#[derive(Clone, Copy)]
struct Motor {
    rate: f64,
    gain: f64,
    torque: f64,
}

fn unless_joint(body: &Body, id: i32, joint: i32) -> PyResult<usize> {
    usize::try_from(joint).ok().filter(|&joint| joint < body.links).ok_or_else(|| {
        refuse(format!("Joint index out-of-range: jointIndex is {joint}, but body {id} has {} joints", body.links))
    })
}

fn checked_mode(mode: i32) -> PyResult<i32> {
    match mode {
        VELOCITY_CONTROL | TORQUE_CONTROL => Ok(mode),
        _ => Err(refuse(format!("controlMode is {mode}, but this drop-in has VELOCITY_CONTROL and TORQUE_CONTROL only"))),
    }
}

fn add_torques(client: &mut Client, body: i32, joints: &[i32], torques: &[f64]) -> PyResult<()> {
    let found = client.body(body)?;
    for &joint in joints {
        unless_joint(found, body, joint)?;
    }
    let id = found.id;
    client.world.add_joint_torques(id, joints, torques).map_err(refused("forces"))
}

fn set_motors(client: &mut Client, body: i32, joints: &[i32], motors: &[Motor]) -> PyResult<()> {
    let found = client.body(body)?;
    let links = joints.iter().map(|&joint| unless_joint(found, body, joint)).collect::<PyResult<Vec<_>>>()?;
    let (id, time_step) = (found.id, client.time_step);
    for (link, motor) in links.into_iter().zip(motors) {
        let impulse = motor.torque * time_step;
        client.world.set_motor(id, link, motor.rate, motor.gain, impulse).map_err(refused("force"))?;
    }
    Ok(())
}

/// Sets a joint's motor, or a torque on it for the coming step.
#[pyfunction]
#[pyo3(signature = (
    bodyUniqueId, jointIndex, controlMode, targetPosition=None, targetVelocity=None, force=None, positionGain=None,
    velocityGain=None, maxVelocity=None, physicsClientId=0
))]
#[allow(clippy::too_many_arguments)]
fn setJointMotorControl2(
    bodyUniqueId: &Bound<'_, PyAny>,
    jointIndex: &Bound<'_, PyAny>,
    controlMode: &Bound<'_, PyAny>,
    targetPosition: Option<&Bound<'_, PyAny>>,
    targetVelocity: Option<&Bound<'_, PyAny>>,
    force: Option<&Bound<'_, PyAny>>,
    positionGain: Option<&Bound<'_, PyAny>>,
    velocityGain: Option<&Bound<'_, PyAny>>,
    maxVelocity: Option<&Bound<'_, PyAny>>,
    physicsClientId: i32,
) -> PyResult<()> {
    // PyBullet reads these in its control by position only.
    let _ = (targetPosition, positionGain, maxVelocity);
    let body = integer("bodyUniqueId", bodyUniqueId)?;
    let joint = integer("jointIndex", jointIndex)?;
    if checked_mode(integer("controlMode", controlMode)?)? == TORQUE_CONTROL {
        let torque = force.map_or(Ok(MOTOR_TORQUE), |force| number("force", force))?;
        return with(physicsClientId, |client| add_torques(client, body, &[joint], &[torque]));
    }
    let motor = Motor {
        rate: targetVelocity.map_or(Ok(0.0), |rate| number("targetVelocity", rate))?,
        gain: velocityGain.map_or(Ok(MOTOR_GAIN), |gain| number("velocityGain", gain))?,
        torque: force.map_or(Ok(MOTOR_TORQUE), |force| not_negative("force", force))?,
    };
    with(physicsClientId, |client| set_motors(client, body, &[joint], &[motor]))
}

/// Sets the motors of some joints, or torques on them for the coming step.
#[pyfunction]
#[pyo3(signature = (
    bodyUniqueId, jointIndices, controlMode, targetPositions=None, targetVelocities=None, forces=None, positionGains=None,
    velocityGains=None, physicsClientId=0
))]
#[allow(clippy::too_many_arguments)]
fn setJointMotorControlArray(
    bodyUniqueId: &Bound<'_, PyAny>,
    jointIndices: &Bound<'_, PyAny>,
    controlMode: &Bound<'_, PyAny>,
    targetPositions: Option<&Bound<'_, PyAny>>,
    targetVelocities: Option<&Bound<'_, PyAny>>,
    forces: Option<&Bound<'_, PyAny>>,
    positionGains: Option<&Bound<'_, PyAny>>,
    velocityGains: Option<&Bound<'_, PyAny>>,
    physicsClientId: i32,
) -> PyResult<()> {
    let _ = (targetPositions, positionGains);
    let body = integer("bodyUniqueId", bodyUniqueId)?;
    let joints = integer_list("jointIndices", jointIndices)?;
    let list = |name: &str, value: Option<&Bound<'_, PyAny>>, default: f64| -> PyResult<Vec<f64>> {
        let Some(value) = value else { return Ok(vec![default; joints.len()]) };
        let values = number_list(name, value)?;
        if values.len() != joints.len() {
            let found = values.len();
            return Err(refuse(format!(
                "number of {name} should match the joint indices: {found} {name}, {} jointIndices",
                joints.len()
            )));
        }
        Ok(values)
    };
    if checked_mode(integer("controlMode", controlMode)?)? == TORQUE_CONTROL {
        let torques = list("forces", forces, 0.0)?;
        return with(physicsClientId, |client| add_torques(client, body, &joints, &torques));
    }
    let rates = list("targetVelocities", targetVelocities, 0.0)?;
    let gains = list("velocityGains", velocityGains, MOTOR_GAIN)?;
    let torques = list("forces", forces, MOTOR_TORQUE)?;
    if let Some(torque) = torques.iter().find(|torque| **torque < 0.0) {
        return Err(refuse(format!("forces has {torque}, but a motor's must not be negative")));
    }
    let values = rates.into_iter().zip(gains).zip(torques);
    let motors: Vec<Motor> = values.map(|((rate, gain), torque)| Motor { rate, gain, torque }).collect();
    with(physicsClientId, |client| set_motors(client, body, &joints, &motors))
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(setJointMotorControl2, module)?)?;
    module.add_function(wrap_pyfunction!(setJointMotorControlArray, module)?)
}
