//! Arguments are checked here before they cross to C++.

use bullet_sys as sys;

use super::BulletError;
use super::body::BoxLink;

pub(super) fn finite(what: &'static str, values: &[f64]) -> Result<(), BulletError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(BulletError::Value { what, value, needed: "finite" }),
        None => Ok(()),
    }
}

pub(super) fn positive(what: &'static str, values: &[f64]) -> Result<(), BulletError> {
    match values.iter().find(|value| !(value.is_finite() && **value > 0.0)) {
        Some(&value) => Err(BulletError::Value { what, value, needed: "positive and finite" }),
        None => Ok(()),
    }
}

pub(super) fn not_negative(what: &'static str, value: f64) -> Result<(), BulletError> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(BulletError::Value { what, value, needed: "zero or more and finite" })
    }
}

pub(super) fn share(what: &'static str, value: f64) -> Result<(), BulletError> {
    if (0.0..=1.0).contains(&value) { Ok(()) } else { Err(BulletError::Value { what, value, needed: "from 0 to 1" }) }
}

pub(super) fn index(value: usize) -> Result<i32, BulletError> {
    i32::try_from(value).map_err(|_| BulletError::Refused("more than 2^31 elements".into()))
}

pub(super) fn raw_link(link: &BoxLink) -> Result<sys::bs_link, BulletError> {
    positive("a mass (g)", &[link.mass])?;
    positive("a half extent (cm)", &link.half_extents)?;
    positive("a collision margin (cm)", &[link.collision_margin])?;
    not_negative("a friction coefficient", link.friction)?;
    share("a coefficient of restitution", link.restitution)?;
    positive("a moment of inertia (g·cm²)", link.inertia.as_ref().map_or(&[], |inertia| &inertia[..]))?;
    finite("an offset of a box (cm)", &link.com_to_box)?;
    finite("a joint offset (cm)", &link.parent_com_to_joint)?;
    finite("a joint offset (cm)", &link.joint_to_com)?;
    finite("a hinge axis", &link.axis)?;
    Ok(sys::bs_link {
        mass: link.mass,
        inertia: link.inertia.unwrap_or_default(),
        half_extents: link.half_extents,
        com_to_box: link.com_to_box,
        parent_com_to_joint: link.parent_com_to_joint,
        joint_to_com: link.joint_to_com,
        axis: link.axis,
        friction: link.friction,
        restitution: link.restitution,
        collision_margin: link.collision_margin,
        parent: link.parent.map_or(Ok(-1), index)?,
        reserved: 0,
    })
}
