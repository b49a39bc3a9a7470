//! Tying bodies to the world, and changing what they are made of.

// Names are PyBullet's.
#![allow(non_snake_case)]

use pyo3::prelude::*;

use super::arguments::{integer, not_negative, numbers, pose, positive};
use super::bodies::JOINT_FIXED;
use super::clients::with;
use super::{refuse, refused};

/// Largest impulse of a constraint that PyBullet makes.
const CONSTRAINT_IMPULSE: f64 = 500.0;

/// Ties the base of a body to the world and returns the constraint's id.
#[pyfunction]
#[pyo3(signature = (
    parentBodyUniqueId, parentLinkIndex, childBodyUniqueId, childLinkIndex, jointType, jointAxis, parentFramePosition,
    childFramePosition, parentFrameOrientation=None, childFrameOrientation=None, physicsClientId=0
))]
#[allow(clippy::too_many_arguments)]
fn createConstraint(
    parentBodyUniqueId: &Bound<'_, PyAny>,
    parentLinkIndex: &Bound<'_, PyAny>,
    childBodyUniqueId: &Bound<'_, PyAny>,
    childLinkIndex: &Bound<'_, PyAny>,
    jointType: &Bound<'_, PyAny>,
    jointAxis: &Bound<'_, PyAny>,
    parentFramePosition: &Bound<'_, PyAny>,
    childFramePosition: &Bound<'_, PyAny>,
    parentFrameOrientation: Option<&Bound<'_, PyAny>>,
    childFrameOrientation: Option<&Bound<'_, PyAny>>,
    physicsClientId: i32,
) -> PyResult<i32> {
    let body = integer("parentBodyUniqueId", parentBodyUniqueId)?;
    for (name, value, only) in [
        ("parentLinkIndex", integer("parentLinkIndex", parentLinkIndex)?, -1),
        ("childBodyUniqueId", integer("childBodyUniqueId", childBodyUniqueId)?, -1),
        ("childLinkIndex", integer("childLinkIndex", childLinkIndex)?, -1),
        ("jointType", integer("jointType", jointType)?, JOINT_FIXED),
    ] {
        if value != only {
            let what = "this drop-in ties a base to the world by JOINT_FIXED only";
            return Err(refuse(format!("createConstraint failed: {name} is {value}, but {what}")));
        }
    }
    numbers::<3>("jointAxis", jointAxis)?;
    let pivot = pose(["parentFramePosition", "parentFrameOrientation"], Some(parentFramePosition), parentFrameOrientation)?;
    let place = pose(["childFramePosition", "childFrameOrientation"], Some(childFramePosition), childFrameOrientation)?;
    with(physicsClientId, |client| {
        let body = client.body(body)?.id;
        client.world.add_anchor(body, &pivot, &place, CONSTRAINT_IMPULSE).map_err(refused("createConstraint"))?;
        client.constraints += 1;
        Ok(client.constraints)
    })
}

/// The link that a call of changeDynamics means. PyBullet's linearDamping, angularDamping and maxJointVelocity are of the whole body: given in the
/// same call they turn it to the base, with its frictions; jointDamping turns it back to the link, where it comes after them.
fn meant(link: i32, dampings: bool, joint_damping: bool, limit: bool) -> i32 {
    if limit || (dampings && !joint_damping) { -1 } else { link }
}

/// Changes frictions of a link (-1: the base), dampings and the limit of the velocities. A link that is not there is left alone, as PyBullet does.
/// With linearDamping or angularDamping and no jointDamping, or with maxJointVelocity, the frictions are the base's, as in PyBullet.
#[pyfunction]
#[pyo3(signature = (
    bodyUniqueId, linkIndex, *, lateralFriction=None, spinningFriction=None, rollingFriction=None, linearDamping=None,
    angularDamping=None, jointDamping=None, maxJointVelocity=None, physicsClientId=0
))]
#[allow(clippy::too_many_arguments)]
fn changeDynamics(
    bodyUniqueId: &Bound<'_, PyAny>,
    linkIndex: &Bound<'_, PyAny>,
    lateralFriction: Option<&Bound<'_, PyAny>>,
    spinningFriction: Option<&Bound<'_, PyAny>>,
    rollingFriction: Option<&Bound<'_, PyAny>>,
    linearDamping: Option<&Bound<'_, PyAny>>,
    angularDamping: Option<&Bound<'_, PyAny>>,
    jointDamping: Option<&Bound<'_, PyAny>>,
    maxJointVelocity: Option<&Bound<'_, PyAny>>,
    physicsClientId: i32,
) -> PyResult<()> {
    let (body, link) = (integer("bodyUniqueId", bodyUniqueId)?, integer("linkIndex", linkIndex)?);
    if link < -1 {
        return Err(refuse(format!("linkIndex is {link}, but the base is -1")));
    }
    let given = |name, value: Option<&Bound<'_, PyAny>>| value.map(|value| not_negative(name, value)).transpose();
    let frictions = [
        given("lateralFriction", lateralFriction)?,
        given("spinningFriction", spinningFriction)?,
        given("rollingFriction", rollingFriction)?,
    ];
    let dampings = [given("linearDamping", linearDamping)?, given("angularDamping", angularDamping)?];
    let joint_damping = given("jointDamping", jointDamping)?;
    let limit = maxJointVelocity.map(|value| positive("maxJointVelocity", value)).transpose()?;
    with(physicsClientId, |client| {
        let (id, links) = client.body(body).map(|body| (body.id, body.links))?;
        let world = &mut client.world;
        world.set_dampings(id, dampings).map_err(refused("changeDynamics"))?;
        if let Some(limit) = limit {
            world.set_velocity_clamp(id, limit).map_err(refused("maxJointVelocity"))?;
        }
        let whole = dampings.iter().any(Option::is_some);
        let link = usize::try_from(meant(link, whole, joint_damping.is_some(), limit.is_some())).ok();
        if link.is_some_and(|link| link >= links) {
            return Ok(());
        }
        world.set_collider_frictions(id, link, frictions).map_err(refused("changeDynamics"))?;
        match (link, joint_damping) {
            (Some(link), Some(damping)) => world.set_joint_damping(id, link, damping).map_err(refused("jointDamping")),
            _ => Ok(()),
        }
    })
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(createConstraint, module)?)?;
    module.add_function(wrap_pyfunction!(changeDynamics, module)?)
}
