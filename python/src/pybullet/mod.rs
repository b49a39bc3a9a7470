//! The native half of `sfers_rs.pybullet`: PyBullet's functions that the published simulator calls, on this project's Bullet.
//!
//! The interpreter stays locked in every call, as in PyBullet: a fork never meets a client half-way, and no other thread can.

// The exception's name is PyBullet's.
#![allow(non_camel_case_types)]

mod arguments;
mod bodies;
mod changes;
mod clients;
mod motors;
mod readings;
mod single;

use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use sfers::bullet::BulletError;

create_exception!(sfers_rs.pybullet, error, PyException, "What PyBullet's functions raise.");

/// A refusal in PyBullet's own exception.
fn refuse(message: impl Into<String>) -> PyErr {
    error::new_err(message.into())
}

/// An error of the Bullet layer on behalf of an argument.
fn refused(argument: &str) -> impl Fn(BulletError) -> PyErr + '_ {
    move |cause| refuse(format!("{argument}: {cause}"))
}

/// Adds the functions, constants and the exception to `module`.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("error", module.py().get_type::<error>())?;
    for (name, value) in [
        ("DIRECT", clients::DIRECT),
        ("SHARED_MEMORY", clients::SHARED_MEMORY),
        ("GEOM_BOX", bodies::GEOM_BOX),
        ("JOINT_REVOLUTE", bodies::JOINT_REVOLUTE),
        ("JOINT_FIXED", bodies::JOINT_FIXED),
        ("VELOCITY_CONTROL", motors::VELOCITY_CONTROL),
        ("TORQUE_CONTROL", motors::TORQUE_CONTROL),
    ] {
        module.add(name, value)?;
    }
    clients::register(module)?;
    bodies::register(module)?;
    changes::register(module)?;
    motors::register(module)?;
    readings::register(module)
}
