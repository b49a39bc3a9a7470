//! Trees of boxes in frames, as PyBullet's `createMultiBody` and `loadURDF` make them: by the same operations, so with the same bits.

use bullet_sys as sys;

use super::body::{BaseState, BodyId};
use super::check::{finite, index, not_negative, positive};
use super::raw::{Message, outcome};
use super::{BulletError, World};

/// How a link of a tree hangs on its parent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TreeJoint {
    /// A hinge.
    Revolute,
    /// No freedom at all.
    Fixed,
}

/// Where something stands in another frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Position of the origin (cm).
    pub position: [f64; 3],
    /// Quaternion x, y, z, w, not zero; its length does not matter.
    pub orientation: [f64; 4],
}

impl Pose {
    /// The pose of a frame in itself.
    pub const IDENTITY: Self = Self { position: [0.0; 3], orientation: [0.0, 0.0, 0.0, 1.0] };
}

/// A box in the frame of its body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TreeBox {
    /// Half the edges along x, y, z (cm).
    pub half_extents: [f64; 3],
    /// The box's centre and axes in the body's frame.
    pub pose: Pose,
}

/// One body of a tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TreeBody {
    /// Mass (g); a base of mass 0 is fixed.
    pub mass: f64,
    /// The frame in the parent's frame; of the base, in the world.
    pub pose: Pose,
    /// Centre of mass and principal axes in the frame.
    pub inertial: Pose,
    /// What the body touches things with, if anything. Its moments of inertia are those of an even box, or of the box around a shifted one.
    pub shape: Option<TreeBox>,
    /// Axis of the hinge in the frame. Ignored for the base and for fixed joints.
    pub axis: [f64; 3],
    /// How it hangs on its parent. Ignored for the base.
    pub joint: TreeJoint,
    /// Index of the parent link; `None` hangs the link on the base. Ignored for the base.
    pub parent: Option<usize>,
    /// Lateral friction coefficient (–).
    pub friction: f64,
    /// Margin of the box (cm).
    pub collision_margin: f64,
    /// Margin of what holds a box that does not stand in the inertial frame (cm).
    pub compound_margin: f64,
}

/// A link as PyBullet reads it: cached by the last step, so one step older than the joint angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkReading {
    /// Centre of mass and principal axes in the world.
    pub inertial: Pose,
    /// Velocity of the centre of mass (cm/s).
    pub velocity: [f64; 3],
    /// Angular velocity (rad/s).
    pub angular_velocity: [f64; 3],
    /// Centre of mass and principal axes in the link's frame.
    pub local: Pose,
}

fn pose(what: &'static str, pose: &Pose) -> Result<(), BulletError> {
    finite(what, &pose.position)?;
    finite(what, &pose.orientation)
}

fn raw_body(body: &TreeBody) -> Result<sys::bs_tree_body, BulletError> {
    not_negative("a mass (g)", body.mass)?;
    not_negative("a friction coefficient", body.friction)?;
    positive("a collision margin (cm)", &[body.collision_margin])?;
    not_negative("a collision margin (cm)", body.compound_margin)?;
    pose("a frame", &body.pose)?;
    pose("an inertial frame", &body.inertial)?;
    finite("a hinge axis", &body.axis)?;
    let unit = TreeBox { half_extents: [0.0; 3], pose: Pose::IDENTITY };
    if let Some(shape) = &body.shape {
        positive("a half extent (cm)", &shape.half_extents)?;
        pose("a frame of a box", &shape.pose)?;
    }
    let shape = body.shape.unwrap_or(unit);
    Ok(sys::bs_tree_body {
        mass: body.mass,
        position: body.pose.position,
        orientation: body.pose.orientation,
        inertial_position: body.inertial.position,
        inertial_orientation: body.inertial.orientation,
        half_extents: shape.half_extents,
        box_position: shape.pose.position,
        box_orientation: shape.pose.orientation,
        axis: body.axis,
        friction: body.friction,
        collision_margin: body.collision_margin,
        compound_margin: body.compound_margin,
        parent: body.parent.map_or(Ok(-1), index)?,
        joint: match body.joint {
            TreeJoint::Revolute => sys::BS_JOINT_REVOLUTE,
            TreeJoint::Fixed => sys::BS_JOINT_FIXED,
        },
        has_box: body.shape.is_some().into(),
        reserved: 0,
    })
}

impl World {
    /// Adds a tree at rest in its zero configuration: `bodies` are the base and the links, depth first.
    ///
    /// It has Bullet's linear and angular damping of 0.04/s, never sleeps, does not collide with itself, and every hinge has a motor that holds
    /// its rate at 0 with at most `motor_impulse` (dyn·cm·s).
    ///
    /// # Errors
    /// [`BulletError::Value`] or [`BulletError::Refused`] for values that make no body.
    pub fn add_tree(&mut self, bodies: &[TreeBody], motor_impulse: f64) -> Result<BodyId, BulletError> {
        self.usable()?;
        not_negative("the largest impulse (dyn·cm·s)", motor_impulse)?;
        let raw = bodies.iter().map(raw_body).collect::<Result<Vec<_>, _>>()?;
        let count = index(raw.len())?;
        let (mut body, mut message) = (-1, Message::new());
        // SAFETY: `count` is the length of raw; the out-pointers are to live locals, the message's length is its own.
        let code = unsafe {
            sys::bs_tree_add(self.pointer(), raw.as_ptr(), count, motor_impulse, &mut body, message.0.as_mut_ptr(), 256)
        };
        self.added(code, &message, body, raw.len().saturating_sub(1))
    }

    /// Ties the frame `pivot` of the base of `body` to the frame `place` of the world, by a soft 6-row constraint of at most `max_impulse` (dyn·s)
    /// a row and step.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`], [`BulletError::Value`] or [`BulletError::Refused`] for values that make no constraint.
    pub fn add_anchor(&mut self, body: BodyId, pivot: &Pose, place: &Pose, max_impulse: f64) -> Result<(), BulletError> {
        self.links_of(body)?;
        pose("a frame", pivot)?;
        pose("a frame", place)?;
        positive("the largest impulse (dyn·s)", &[max_impulse])?;
        let mut message = Message::new();
        // SAFETY: the body's index is valid in this world (links_of); positions and quaternions have the 3 and 4 values asked for; the message's
        // length is its own.
        let code = unsafe {
            sys::bs_anchor_add(
                self.pointer(),
                body.index,
                pivot.position.as_ptr(),
                pivot.orientation.as_ptr(),
                place.position.as_ptr(),
                place.orientation.as_ptr(),
                max_impulse,
                message.0.as_mut_ptr(),
                256,
            )
        };
        self.checked(code, &message)
    }

    /// Sets the motor of a hinge: `rate` (rad/s), the share `gain` of the difference that a step removes (–), and the largest impulse
    /// (dyn·cm·s), 0 for off. Without effect on a fixed joint.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`], [`BulletError::Value`], or [`BulletError::Refused`] for a link that is not there.
    pub fn set_motor(&mut self, body: BodyId, link: usize, rate: f64, gain: f64, max_impulse: f64) -> Result<(), BulletError> {
        self.links_of(body)?;
        finite("a motor's rate (rad/s)", &[rate])?;
        finite("a motor's gain", &[gain])?;
        not_negative("the largest impulse (dyn·cm·s)", max_impulse)?;
        let link = index(link)?;
        // SAFETY: the body's index is valid in this world (links_of); the shim checks the link's.
        let code = unsafe { sys::bs_motor_set(self.pointer(), body.index, link, rate, gain, max_impulse) };
        outcome(code, || "no motor of that index".into())
    }

    /// Reads the impulses (dyn·cm·s) that the motors of a tree gave last.
    ///
    /// # Errors
    /// [`BulletError::Length`] unless there is one value per link.
    pub fn motor_impulses(&self, body: BodyId, impulses: &mut [f64]) -> Result<(), BulletError> {
        let length = self.lengths(body, &[("impulses", impulses.len())])?;
        // SAFETY: the slice holds `length` values, the number of links of this body.
        let code = unsafe { sys::bs_motor_impulses(self.pointer(), body.index, impulses.as_mut_ptr(), length) };
        outcome(code, || "the body has no motors".into())
    }

    /// Adds torques (dyn·cm) on the joints `links` to those for the coming step; on fixed joints they are left out.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`], [`BulletError::Length`], or [`BulletError::Refused`] for a link that is not there.
    pub fn add_joint_torques(&mut self, body: BodyId, links: &[i32], torques: &[f64]) -> Result<(), BulletError> {
        self.links_of(body)?;
        if links.len() != torques.len() {
            return Err(BulletError::Length { what: "torques", found: torques.len(), needed: links.len() });
        }
        let length = index(links.len())?;
        // SAFETY: both slices hold `length` values; the shim checks the links' indices.
        let code = unsafe { sys::bs_joint_torques_add(self.pointer(), body.index, links.as_ptr(), torques.as_ptr(), length) };
        outcome(code, || "no link of that index".into())
    }

    /// Sets lateral (–), spinning (cm) and rolling (cm) friction of the collider of a link, `None` for the base; `None` leaves a friction as it is.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`], [`BulletError::Value`], or [`BulletError::Refused`] for a link that is not there.
    pub fn set_collider_frictions(
        &mut self,
        body: BodyId,
        link: Option<usize>,
        frictions: [Option<f64>; 3],
    ) -> Result<(), BulletError> {
        self.links_of(body)?;
        frictions.iter().flatten().try_for_each(|&friction| not_negative("a friction", friction))?;
        let (link, values) = (link.map_or(Ok(-1), index)?, frictions.map(|friction| friction.unwrap_or(-1.0)));
        // SAFETY: the body's index is valid in this world (links_of); `values` has the 3 values asked for; the shim checks the link's index.
        let code = unsafe { sys::bs_collider_frictions_set(self.pointer(), body.index, link, values.as_ptr()) };
        outcome(code, || "no link of that index".into())
    }

    /// Sets linear and angular damping of a body (1/s); `None` leaves one as it is.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`] or [`BulletError::Value`].
    pub fn set_dampings(&mut self, body: BodyId, dampings: [Option<f64>; 2]) -> Result<(), BulletError> {
        self.links_of(body)?;
        dampings.iter().flatten().try_for_each(|&damping| not_negative("a damping (1/s)", damping))?;
        let values = dampings.map(|damping| damping.unwrap_or(-1.0));
        // SAFETY: the body's index is valid in this world (links_of); `values` has the 2 values asked for.
        let code = unsafe { sys::bs_dampings_set(self.pointer(), body.index, values.as_ptr()) };
        outcome(code, || "damping".into())
    }

    /// Sets the damping of a joint (dyn·cm·s).
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`], [`BulletError::Value`], or [`BulletError::Refused`] for a link that is not there.
    pub fn set_joint_damping(&mut self, body: BodyId, link: usize, damping: f64) -> Result<(), BulletError> {
        self.links_of(body)?;
        not_negative("a damping (dyn·cm·s)", damping)?;
        let link = index(link)?;
        // SAFETY: the body's index is valid in this world (links_of); the shim checks the link's.
        let code = unsafe { sys::bs_joint_damping_set(self.pointer(), body.index, link, damping) };
        outcome(code, || "no link of that index".into())
    }

    /// [`base_state`](Self::base_state) with the quaternion that PyBullet reads: by way of the matrix.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`].
    pub fn base_reading(&self, body: BodyId) -> Result<BaseState, BulletError> {
        self.links_of(body)?;
        let mut s = [0.0; 13];
        // SAFETY: `s` holds the 13 values that the call writes.
        let code = unsafe { sys::bs_base_reading(self.pointer(), body.index, s.as_mut_ptr(), 13) };
        outcome(code, || "base state".into())?;
        Ok(BaseState {
            position: [s[0], s[1], s[2]],
            orientation: [s[3], s[4], s[5], s[6]],
            velocity: [s[7], s[8], s[9]],
            angular_velocity: [s[10], s[11], s[12]],
        })
    }

    /// Reads all links of a tree into `links`, which is cleared first; velocities are 0 unless they are asked for.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`], or [`BulletError::Refused`] for a body that is no tree.
    pub fn link_readings(
        &mut self,
        body: BodyId,
        with_velocities: bool,
        links: &mut Vec<LinkReading>,
    ) -> Result<(), BulletError> {
        const PER_LINK: usize = 20;
        let count = self.links_of(body)?;
        self.scratch.resize(PER_LINK * count, 0.0);
        let length = index(self.scratch.len())?;
        let states = self.scratch.as_mut_ptr();
        // SAFETY: the buffer holds 20 values per link of this body, which is what the call writes.
        let code = unsafe { sys::bs_link_readings(self.raw.0.as_ptr(), body.index, with_velocities.into(), states, length) };
        outcome(code, || "the body is no tree".into())?;
        links.clear();
        let pose = |s: &[f64]| Pose { position: [s[0], s[1], s[2]], orientation: [s[3], s[4], s[5], s[6]] };
        links.extend(self.scratch.chunks_exact(PER_LINK).map(|s| LinkReading {
            inertial: pose(s),
            velocity: [s[7], s[8], s[9]],
            angular_velocity: [s[10], s[11], s[12]],
            local: pose(&s[13..]),
        }));
        Ok(())
    }
}
