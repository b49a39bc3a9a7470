//! What is read of a world and set in it between steps: joints, base, links, forces and contacts.

use bullet_sys as sys;

use super::body::{BaseState, BodyId, Contact, LinkState, VelocityClamp, Wrench};
use super::check::{finite, index, not_negative, positive};
use super::raw::{Message, outcome};
use super::{BulletError, World};

impl World {
    /// Number of joints of `body`.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`].
    pub fn joint_count(&self, body: BodyId) -> Result<usize, BulletError> {
        self.links_of(body)
    }

    /// Reads all joint angles (rad) and rates (rad/s).
    ///
    /// # Errors
    /// [`BulletError::Length`] unless both slices hold one value per joint.
    pub fn joint_states(&self, body: BodyId, angles: &mut [f64], rates: &mut [f64]) -> Result<(), BulletError> {
        let length = self.lengths(body, &[("angles", angles.len()), ("rates", rates.len())])?;
        // SAFETY: both slices hold `length` values, the number of joints of this body.
        let code = unsafe { sys::bs_joint_states(self.pointer(), body.index, angles.as_mut_ptr(), rates.as_mut_ptr(), length) };
        outcome(code, || "joint states".into())
    }

    /// Sets all joint angles (rad) and rates (rad/s).
    ///
    /// # Errors
    /// [`BulletError::Length`], or [`BulletError::Value`] for values that are not finite.
    pub fn set_joint_states(&mut self, body: BodyId, angles: &[f64], rates: &[f64]) -> Result<(), BulletError> {
        let length = self.lengths(body, &[("angles", angles.len()), ("rates", rates.len())])?;
        finite("a joint angle (rad)", angles)?;
        finite("a joint rate (rad/s)", rates)?;
        // SAFETY: both slices hold `length` values, the number of joints of this body.
        let code = unsafe { sys::bs_joint_states_set(self.pointer(), body.index, angles.as_ptr(), rates.as_ptr(), length) };
        self.checked(code, &Message::new())
    }

    /// Sets the torque on every joint (dyn·cm) for the coming step.
    ///
    /// # Errors
    /// [`BulletError::Length`] unless there is one value per joint.
    pub fn set_joint_torques(&mut self, body: BodyId, torques: &[f64]) -> Result<(), BulletError> {
        let length = self.lengths(body, &[("torques", torques.len())])?;
        // SAFETY: the slice holds `length` values, the number of joints of this body.
        let code = unsafe { sys::bs_joint_torques_set(self.pointer(), body.index, torques.as_ptr(), length) };
        self.checked(code, &Message::new())
    }

    /// Adds forces for the coming step, one entry for the base and then one per link.
    ///
    /// # Errors
    /// [`BulletError::Length`] unless there is one entry per body, [`BulletError::Value`] for values that are not finite.
    pub fn add_forces(&mut self, body: BodyId, forces: &[Wrench]) -> Result<(), BulletError> {
        self.one_per_body(body, "forces", forces.len())?;
        for Wrench { force, torque } in forces {
            finite("a force (dyn)", force)?;
            finite("a torque (dyn·cm)", torque)?;
        }
        let length = index(6 * forces.len())?;
        // SAFETY: a Wrench is 6 doubles in C's order, and the slice holds one per body of this multibody.
        let code = unsafe { sys::bs_forces_add(self.pointer(), body.index, forces.as_ptr().cast(), length) };
        self.checked(code, &Message::new())
    }

    /// Sets the lateral friction coefficients (–) of all boxes, the base's first, and of the contact points that they have. Like the
    /// solver's settings they are not part of a snapshot.
    ///
    /// # Errors
    /// [`BulletError::Length`] unless there is one value per body, [`BulletError::Value`] for values that are negative or not finite.
    pub fn set_frictions(&mut self, body: BodyId, frictions: &[f64]) -> Result<(), BulletError> {
        self.one_per_body(body, "frictions", frictions.len())?;
        frictions.iter().try_for_each(|&friction| not_negative("a friction coefficient", friction))?;
        let length = index(frictions.len())?;
        // SAFETY: the slice holds `length` values, one per body of this multibody.
        let code = unsafe { sys::bs_frictions_set(self.pointer(), body.index, frictions.as_ptr(), length) };
        self.checked(code, &Message::new())
    }

    /// Pose and velocity of the base, current.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`].
    pub fn base_state(&self, body: BodyId) -> Result<BaseState, BulletError> {
        self.links_of(body)?;
        let mut s = [0.0; 13];
        // SAFETY: `s` holds the 13 values that the call writes.
        let code = unsafe { sys::bs_base_state(self.pointer(), body.index, s.as_mut_ptr(), 13) };
        outcome(code, || "base state".into())?;
        Ok(BaseState {
            position: [s[0], s[1], s[2]],
            orientation: [s[3], s[4], s[5], s[6]],
            velocity: [s[7], s[8], s[9]],
            angular_velocity: [s[10], s[11], s[12]],
        })
    }

    /// Sets pose and velocity of the base. The collision boxes follow in the next step.
    ///
    /// # Errors
    /// [`BulletError::Value`] for values that are not finite, [`BulletError::Refused`] for a quaternion that is not of unit length.
    pub fn set_base_state(&mut self, body: BodyId, state: &BaseState) -> Result<(), BulletError> {
        self.links_of(body)?;
        let mut s = [0.0; 13];
        s[..3].copy_from_slice(&state.position);
        s[3..7].copy_from_slice(&state.orientation);
        s[7..10].copy_from_slice(&state.velocity);
        s[10..].copy_from_slice(&state.angular_velocity);
        finite("a base state", &s)?;
        // SAFETY: `s` holds the 13 values that the call reads.
        let code = unsafe { sys::bs_base_state_set(self.pointer(), body.index, s.as_ptr(), 13) };
        outcome(code, || "the orientation is not a unit quaternion".into())
    }

    /// Reads all links, as cached by the last step, into `links`, which is cleared first.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`].
    pub fn link_states(&mut self, body: BodyId, links: &mut Vec<LinkState>) -> Result<(), BulletError> {
        let count = self.links_of(body)?;
        self.scratch.resize(18 * count, 0.0);
        let length = index(self.scratch.len())?;
        // SAFETY: the buffer holds 18 values per link of this body, which is what the call writes.
        let code = unsafe { sys::bs_link_states(self.raw.0.as_ptr(), body.index, self.scratch.as_mut_ptr(), length) };
        outcome(code, || "link states".into())?;
        links.clear();
        links.extend(self.scratch.chunks_exact(18).map(|s| LinkState {
            position: [s[0], s[1], s[2]],
            rotation: [[s[3], s[4], s[5]], [s[6], s[7], s[8]], [s[9], s[10], s[11]]],
            velocity: [s[12], s[13], s[14]],
            angular_velocity: [s[15], s[16], s[17]],
        }));
        Ok(())
    }

    /// The largest generalised velocity of `body` beside Bullet's clamp.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`].
    pub fn velocity_clamp(&self, body: BodyId) -> Result<VelocityClamp, BulletError> {
        self.links_of(body)?;
        let mut clamp = VelocityClamp { limit: 0.0, largest: 0.0 };
        // SAFETY: both out-pointers are to live fields.
        let code = unsafe { sys::bs_velocity_clamp(self.pointer(), body.index, &mut clamp.limit, &mut clamp.largest) };
        outcome(code, || "velocity clamp".into())?;
        Ok(clamp)
    }

    /// Sets the velocity that Bullet clamps every generalised velocity of `body` to (cm/s or rad/s); that of a new body is 100.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`], [`BulletError::Value`] unless the limit is positive and finite.
    pub fn set_velocity_clamp(&mut self, body: BodyId, limit: f64) -> Result<(), BulletError> {
        self.links_of(body)?;
        positive("a velocity limit (cm/s or rad/s)", &[limit])?;
        // SAFETY: the body's index is valid in this world (links_of).
        let code = unsafe { sys::bs_velocity_clamp_set(self.pointer(), body.index, limit) };
        outcome(code, || "velocity clamp".into())
    }

    /// Reads the contact points of the last step into `contacts`, which is cleared first, in Bullet's order.
    ///
    /// # Errors
    /// [`BulletError::Broken`].
    pub fn contacts(&mut self, contacts: &mut Vec<Contact>) -> Result<(), BulletError> {
        self.usable()?;
        let mut count = 0;
        loop {
            let capacity = index(self.contacts.len())?;
            // SAFETY: the buffer holds `capacity` entries; the call writes no more than that.
            let code = unsafe { sys::bs_contacts(self.raw.0.as_ptr(), self.contacts.as_mut_ptr(), capacity, &mut count) };
            outcome(code, || "contacts".into())?;
            if count <= capacity {
                break;
            }
            // SAFETY: bs_contact is a plain C structure of numbers, for which all bits zero is a value.
            self.contacts.resize(count.unsigned_abs() as usize, unsafe { std::mem::zeroed() });
        }
        let place = |body, link| (BodyId { world: self.id, index: body }, usize::try_from(link).ok());
        contacts.clear();
        contacts.extend(self.contacts[..count.unsigned_abs() as usize].iter().map(|c| Contact {
            a: place(c.body_a, c.link_a),
            b: place(c.body_b, c.link_b),
            position: c.position_on_b,
            normal: c.normal_on_b,
            distance: c.distance,
            normal_impulse: c.normal_impulse,
            friction_impulse: c.friction_impulse,
            friction_directions: [c.friction_direction_1, c.friction_direction_2],
        }));
        Ok(())
    }
}
