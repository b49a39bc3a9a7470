//! The world: the one owner of everything that lives in Bullet.

use std::ffi::{CStr, c_char};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU64, Ordering};

use bullet_sys as sys;

use super::body::{BaseState, BodyId, BoxLink, Contact, Ground, LinkState, VelocityClamp, Wrench};
use super::{BulletError, SolverSettings, library};

static NEXT_WORLD: AtomicU64 = AtomicU64::new(1);

/// Everything that a later step of a world depends on.
///
/// A snapshot fits any world that was built by the same calls in the same order, in this process or another.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    data: Vec<f64>,
}

impl Snapshot {
    /// The snapshot as plain numbers, for storing.
    pub fn as_slice(&self) -> &[f64] {
        &self.data
    }

    /// The snapshot's numbers themselves.
    pub fn into_vec(self) -> Vec<f64> {
        self.data
    }

    /// A snapshot from stored numbers. Whether they fit is checked by [`World::restore`].
    pub fn from_vec(data: Vec<f64>) -> Self {
        Self { data }
    }
}

/// A Bullet world with multibodies.
pub struct World {
    raw: RawWorld,
    id: u64,
    /// Number of links of each body, by index.
    link_counts: Vec<usize>,
    broken: bool,
    scratch: Vec<f64>,
    contacts: Vec<sys::bs_contact>,
}

/// The only owner of the C++ object.
struct RawWorld(NonNull<sys::bs_world>);

impl Drop for RawWorld {
    fn drop(&mut self) {
        // SAFETY: the pointer came from bs_world_create, is freed nowhere else, and this owner is gone after this call.
        unsafe { sys::bs_world_destroy(self.0.as_ptr()) }
    }
}

// SAFETY: a bs_world holds no thread-local state and no pointer into the thread that made it. Bullet's process-wide variables are
// only read while stepping, save for debug counters that nothing reads back; gDbvtMargin is written once, under call_once. So a
// world may move to another thread. It is not Sync: reading link velocities uses scratch inside the C++ object.
unsafe impl Send for RawWorld {}

/// A buffer that the shim writes its message to.
struct Message([c_char; 256]);

impl Message {
    fn new() -> Self {
        Self([0; 256])
    }

    fn text(&self) -> String {
        let bytes = self.0.map(|c| c.cast_unsigned());
        CStr::from_bytes_until_nul(&bytes).map(|text| text.to_string_lossy().into_owned()).unwrap_or_default()
    }
}

fn outcome(code: i32, message: impl FnOnce() -> String) -> Result<(), BulletError> {
    match code {
        sys::BS_OK => Ok(()),
        sys::BS_ERROR_ARGUMENT => Err(BulletError::Refused(message())),
        sys::BS_ERROR_SNAPSHOT => Err(BulletError::Snapshot(message())),
        _ => Err(BulletError::Internal(message())),
    }
}

fn finite(what: &'static str, values: &[f64]) -> Result<(), BulletError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(BulletError::Value { what, value, needed: "finite" }),
        None => Ok(()),
    }
}

fn positive(what: &'static str, values: &[f64]) -> Result<(), BulletError> {
    match values.iter().find(|value| !(value.is_finite() && **value > 0.0)) {
        Some(&value) => Err(BulletError::Value { what, value, needed: "positive and finite" }),
        None => Ok(()),
    }
}

fn not_negative(what: &'static str, value: f64) -> Result<(), BulletError> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(BulletError::Value { what, value, needed: "zero or more and finite" })
    }
}

fn share(what: &'static str, value: f64) -> Result<(), BulletError> {
    if (0.0..=1.0).contains(&value) { Ok(()) } else { Err(BulletError::Value { what, value, needed: "from 0 to 1" }) }
}

fn index(value: usize) -> Result<i32, BulletError> {
    i32::try_from(value).map_err(|_| BulletError::Refused("more than 2^31 elements".into()))
}

fn raw_link(link: &BoxLink) -> Result<sys::bs_link, BulletError> {
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

impl World {
    /// An empty world.
    ///
    /// # Errors
    /// [`BulletError::WrongLibrary`] if the loaded Bullet is not double precision 3.24; [`BulletError::Value`] for settings that
    /// are not finite or out of range.
    pub fn new(settings: &SolverSettings) -> Result<Self, BulletError> {
        library::check()?;
        finite("gravity (cm/s²)", &settings.gravity)?;
        for (what, value) in [
            ("erp2", settings.erp2),
            ("friction_erp", settings.friction_erp),
            ("linear_slop (cm)", settings.linear_slop),
            ("warmstarting_factor", settings.warmstarting_factor),
            ("least_squares_residual_threshold", settings.least_squares_residual_threshold),
            ("broadphase_velocity_prediction", settings.broadphase_velocity_prediction),
        ] {
            not_negative(what, value)?;
        }
        let raw_settings = sys::bs_settings {
            gravity: settings.gravity,
            erp2: settings.erp2,
            friction_erp: settings.friction_erp,
            linear_slop: settings.linear_slop,
            warmstarting_factor: settings.warmstarting_factor,
            least_squares_residual_threshold: settings.least_squares_residual_threshold,
            broadphase_velocity_prediction: settings.broadphase_velocity_prediction,
            solver_iterations: index(settings.solver_iterations as usize)?,
            minimum_solver_batch_size: index(settings.minimum_solver_batch_size as usize)?,
            force_update_all_aabbs: settings.force_update_all_aabbs.into(),
            reserved: 0,
        };
        let mut world = std::ptr::null_mut();
        let mut message = Message::new();
        // SAFETY: settings and the two out-pointers are live locals; the message's length is its own.
        let code = unsafe { sys::bs_world_create(&raw_settings, &mut world, message.0.as_mut_ptr(), 256) };
        outcome(code, || message.text())?;
        let raw = NonNull::new(world).ok_or_else(|| BulletError::Internal("no world came back".into()))?;
        Ok(Self {
            raw: RawWorld(raw),
            id: NEXT_WORLD.fetch_add(1, Ordering::Relaxed),
            link_counts: Vec::new(),
            broken: false,
            scratch: Vec::new(),
            contacts: Vec::new(),
        })
    }

    /// Adds a multibody at rest in its zero configuration, its base's centre of mass at `base_position` (cm).
    ///
    /// It never sleeps, its links do not collide with one another, and its linear and angular damping are 0.
    ///
    /// # Errors
    /// [`BulletError::Value`] or [`BulletError::Refused`] for masses, extents, axes or parents that make no body.
    pub fn add_multibody(&mut self, base: &BoxLink, links: &[BoxLink], base_position: [f64; 3]) -> Result<BodyId, BulletError> {
        self.usable()?;
        finite("a base position (cm)", &base_position)?;
        let raw_base = raw_link(base)?;
        let raw_links = links.iter().map(raw_link).collect::<Result<Vec<_>, _>>()?;
        let count = index(links.len())?;
        let mut body = -1;
        let mut message = Message::new();
        // SAFETY: all pointers are to live locals; `count` is the length of raw_links, base_position has the 3 values asked for.
        let code = unsafe {
            sys::bs_multibody_add(
                self.pointer(),
                &raw_base,
                raw_links.as_ptr(),
                count,
                base_position.as_ptr(),
                &mut body,
                message.0.as_mut_ptr(),
                256,
            )
        };
        self.added(code, &message, body, links.len())
    }

    /// Adds a static floor.
    ///
    /// # Errors
    /// [`BulletError::Value`] for extents or coefficients out of range.
    pub fn add_ground(&mut self, ground: &Ground) -> Result<BodyId, BulletError> {
        self.usable()?;
        positive("a half extent (cm)", &ground.half_extents)?;
        positive("a collision margin (cm)", &[ground.collision_margin])?;
        not_negative("a friction coefficient", ground.friction)?;
        share("a coefficient of restitution", ground.restitution)?;
        finite("the height of the ground (cm)", &[ground.top])?;
        let mut body = -1;
        let mut message = Message::new();
        // SAFETY: half_extents has the 3 values asked for; the other pointers are to live locals.
        let code = unsafe {
            sys::bs_ground_add(
                self.pointer(),
                ground.half_extents.as_ptr(),
                ground.top,
                ground.friction,
                ground.restitution,
                ground.collision_margin,
                &mut body,
                message.0.as_mut_ptr(),
                256,
            )
        };
        self.added(code, &message, body, 0)
    }

    fn added(&mut self, code: i32, message: &Message, body: i32, links: usize) -> Result<BodyId, BulletError> {
        self.checked(code, message)?;
        self.link_counts.push(links);
        Ok(BodyId { world: self.id, index: body })
    }

    /// Ties the base of `body` to where it stands, by a soft 6-row constraint of at most `max_impulse` (dyn·s) a row and step.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`], or [`BulletError::Value`] for an impulse that is not positive.
    pub fn add_fixed_constraint(&mut self, body: BodyId, max_impulse: f64) -> Result<(), BulletError> {
        self.links_of(body)?;
        positive("the largest impulse (dyn·s)", &[max_impulse])?;
        let mut message = Message::new();
        // SAFETY: the body's index is valid in this world (links_of); the message's length is its own.
        let code = unsafe { sys::bs_fixed_constraint_add(self.pointer(), body.index, max_impulse, message.0.as_mut_ptr(), 256) };
        self.checked(code, &message)
    }

    /// The same with a tie that gives: the base may turn about its y axis, at `pivot` (cm, in its frame), by `compliance` (rad/(dyn·cm))
    /// times the moment on it. The spring is implicit, so that no compliance is too small for a step.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`], [`BulletError::Value`] for a compliance or an impulse that is not positive, or
    /// [`BulletError::Refused`] for a body that is no chain of links.
    pub fn add_sprung_constraint(
        &mut self,
        body: BodyId,
        pivot: [f64; 3],
        compliance: f64,
        max_impulse: f64,
    ) -> Result<(), BulletError> {
        self.links_of(body)?;
        finite("a pivot (cm)", &pivot)?;
        positive("a compliance (rad/(dyn·cm))", &[compliance])?;
        positive("the largest impulse (dyn·s)", &[max_impulse])?;
        let mut message = Message::new();
        // SAFETY: the body's index is valid in this world (links_of); pivot has the 3 values asked for; the message's length is its own.
        let code = unsafe {
            sys::bs_sprung_constraint_add(
                self.pointer(),
                body.index,
                pivot.as_ptr(),
                compliance,
                max_impulse,
                message.0.as_mut_ptr(),
                256,
            )
        };
        self.checked(code, &message)
    }

    /// Sets gravity (cm/s²).
    ///
    /// # Errors
    /// [`BulletError::Value`] if it is not finite.
    pub fn set_gravity(&mut self, gravity: [f64; 3]) -> Result<(), BulletError> {
        self.usable()?;
        finite("gravity (cm/s²)", &gravity)?;
        // SAFETY: gravity has the 3 values asked for.
        let code = unsafe { sys::bs_world_set_gravity(self.pointer(), gravity.as_ptr()) };
        self.checked(code, &Message::new())
    }

    /// Advances the world by one step of `time_step` (s). Torques set before act during this step only.
    ///
    /// # Errors
    /// [`BulletError::Value`] for a step that is not positive; [`BulletError::Internal`] if Bullet threw, after which the world is
    /// broken. A state that turned infinite is not an error here: the caller who knows the joints' names looks for it.
    pub fn step(&mut self, time_step: f64) -> Result<(), BulletError> {
        self.usable()?;
        positive("the time step (s)", &[time_step])?;
        let mut message = Message::new();
        // SAFETY: the world is live and not broken; the message's length is its own.
        let code = unsafe { sys::bs_world_step(self.pointer(), time_step, message.0.as_mut_ptr(), 256) };
        self.checked(code, &message)
    }

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

    /// Takes a snapshot: a later [`restore`](Self::restore) continues with the same bits as if nothing had happened between.
    ///
    /// # Errors
    /// [`BulletError::Broken`], or [`BulletError::Internal`].
    pub fn snapshot(&self) -> Result<Snapshot, BulletError> {
        self.usable()?;
        let mut size = 0;
        // SAFETY: the out-pointer is to a live local.
        let code = unsafe { sys::bs_snapshot_size(self.pointer(), &mut size) };
        outcome(code, || "snapshot size".into())?;
        let mut data = vec![0.0; size.unsigned_abs() as usize];
        let mut message = Message::new();
        // SAFETY: `data` holds `size` values; the message's length is its own.
        let code = unsafe { sys::bs_snapshot_take(self.pointer(), data.as_mut_ptr(), size, message.0.as_mut_ptr(), 256) };
        outcome(code, || message.text())?;
        Ok(Snapshot { data })
    }

    /// Puts the world back to a snapshot, its own or that of a world built by the same calls.
    ///
    /// # Errors
    /// [`BulletError::Snapshot`] if it does not fit, with nothing changed.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), BulletError> {
        self.usable()?;
        let length = index(snapshot.data.len())?;
        let mut message = Message::new();
        // SAFETY: the slice holds `length` values, and the shim checks what they say before it uses them.
        let code =
            unsafe { sys::bs_snapshot_restore(self.pointer(), snapshot.data.as_ptr(), length, message.0.as_mut_ptr(), 256) };
        self.checked(code, &message)
    }

    fn pointer(&self) -> *mut sys::bs_world {
        self.raw.0.as_ptr()
    }

    fn usable(&self) -> Result<(), BulletError> {
        if self.broken { Err(BulletError::Broken) } else { Ok(()) }
    }

    fn links_of(&self, body: BodyId) -> Result<usize, BulletError> {
        self.usable()?;
        if body.world != self.id {
            return Err(BulletError::ForeignBody);
        }
        Ok(self.link_counts[body.index.unsigned_abs() as usize])
    }

    fn one_per_body(&self, body: BodyId, what: &'static str, found: usize) -> Result<(), BulletError> {
        let needed = self.links_of(body)? + 1;
        if found == needed { Ok(()) } else { Err(BulletError::Length { what, found, needed }) }
    }

    fn lengths(&self, body: BodyId, arrays: &[(&'static str, usize)]) -> Result<i32, BulletError> {
        let needed = self.links_of(body)?;
        for &(what, found) in arrays {
            if found != needed {
                return Err(BulletError::Length { what, found, needed });
            }
        }
        index(needed)
    }

    /// Turns a code into a result, and marks the world broken where the header says that it is.
    fn checked(&mut self, code: i32, message: &Message) -> Result<(), BulletError> {
        let result = outcome(code, || message.text());
        self.broken |= matches!(result, Err(BulletError::Internal(_)));
        result
    }
}
