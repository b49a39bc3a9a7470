//! The world: the one owner of everything that lives in Bullet.

use std::ptr::NonNull;
use std::sync::atomic::{AtomicU64, Ordering};

use bullet_sys as sys;

use super::body::{BodyId, BoxLink, Ground};
use super::check::{finite, index, not_negative, positive, raw_link, share};
use super::raw::{Message, RawWorld, outcome};
use super::{BulletError, SolverSettings, library};

static NEXT_WORLD: AtomicU64 = AtomicU64::new(1);

/// A Bullet world with multibodies.
pub struct World {
    pub(super) raw: RawWorld,
    pub(super) id: u64,
    /// Number of links of each body, by index.
    link_counts: Vec<usize>,
    broken: bool,
    pub(super) scratch: Vec<f64>,
    pub(super) contacts: Vec<sys::bs_contact>,
}

/// How a base that gives is tied to the world.
enum Tie {
    /// By a spring with its compliance (rad/(dyn·cm)) and hardening (1/rad).
    Sprung { compliance: f64, hardening: f64 },
    /// With a compliance (rad/(dyn·cm)) at the multiples of a moment (dyn·cm).
    Bent { width: f64, compliances: [f64; sys::BS_CLAMP_POINTS as usize] },
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

    pub(super) fn added(&mut self, code: i32, message: &Message, body: i32, links: usize) -> Result<BodyId, BulletError> {
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
    /// times the moment on it, with a damper of `damping_time` (s) times the spring's stiffness, and harder the more it turns: the moment of a turn φ
    /// is φ (1 + (`hardening` φ)²)/`compliance`, `hardening` in 1/rad. Both are implicit, so that no compliance is too small for a step.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`], [`BulletError::Value`] for a compliance or an impulse that is not positive or a negative damping time or hardening, or
    /// [`BulletError::Refused`] for a body that is no chain of links.
    pub fn add_sprung_constraint(
        &mut self,
        body: BodyId,
        pivot: [f64; 3],
        compliance: f64,
        damping_time: f64,
        hardening: f64,
        max_impulse: f64,
    ) -> Result<(), BulletError> {
        positive("a compliance (rad/(dyn·cm))", &[compliance])?;
        not_negative("a hardening (1/rad)", hardening)?;
        self.add_tie(body, pivot, &Tie::Sprung { compliance, hardening }, damping_time, max_impulse)
    }

    /// The same with a compliance that depends on the moment: `compliances` (rad/(dyn·cm)) at the multiples of `width` (dyn·cm) from −3 to 3, linear
    /// between them and constant beyond, positive about y. The turn is the integral of the compliance over the moment.
    ///
    /// # Errors
    /// As [`add_sprung_constraint`](Self::add_sprung_constraint); also for a width that is not positive.
    pub fn add_bent_constraint(
        &mut self,
        body: BodyId,
        pivot: [f64; 3],
        width: f64,
        compliances: [f64; sys::BS_CLAMP_POINTS as usize],
        damping_time: f64,
        max_impulse: f64,
    ) -> Result<(), BulletError> {
        positive("a width (dyn·cm)", &[width])?;
        positive("a compliance (rad/(dyn·cm))", &compliances)?;
        self.add_tie(body, pivot, &Tie::Bent { width, compliances }, damping_time, max_impulse)
    }

    /// Ties the base of `body` with a law that was checked.
    fn add_tie(
        &mut self,
        body: BodyId,
        pivot: [f64; 3],
        tie: &Tie,
        damping_time: f64,
        max_impulse: f64,
    ) -> Result<(), BulletError> {
        self.links_of(body)?;
        finite("a pivot (cm)", &pivot)?;
        not_negative("a damping time (s)", damping_time)?;
        positive("the largest impulse (dyn·s)", &[max_impulse])?;
        let (world, index, at) = (self.pointer(), body.index, pivot.as_ptr());
        let mut message = Message::new();
        let text = message.0.as_mut_ptr();
        // SAFETY: the body's index is valid in this world (links_of); pivot and compliances have the 3 and BS_CLAMP_POINTS values asked for; the message's
        // length is its own.
        let code = unsafe {
            match tie {
                Tie::Sprung { compliance, hardening } => {
                    sys::bs_sprung_constraint_add(world, index, at, *compliance, damping_time, *hardening, max_impulse, text, 256)
                }
                Tie::Bent { width, compliances } => sys::bs_bent_constraint_add(
                    world,
                    index,
                    at,
                    *width,
                    compliances.as_ptr(),
                    damping_time,
                    max_impulse,
                    text,
                    256,
                ),
            }
        };
        self.checked(code, &message)
    }

    /// Lets what ties the base of `body` also give in z, by `compliance` (cm/dyn) times the force on it, with a damper of `damping_time` (s) times the
    /// spring's stiffness. Both are implicit.
    ///
    /// # Errors
    /// [`BulletError::ForeignBody`], [`BulletError::Value`] for a compliance that is not positive or a negative damping time, or [`BulletError::Refused`] for a
    /// body that is no chain of links or that nothing ties.
    pub fn set_constraint_shift(&mut self, body: BodyId, compliance: f64, damping_time: f64) -> Result<(), BulletError> {
        self.links_of(body)?;
        positive("a compliance (cm/dyn)", &[compliance])?;
        not_negative("a damping time (s)", damping_time)?;
        let mut message = Message::new();
        // SAFETY: the body's index is valid in this world (links_of); the message's length is its own.
        let code = unsafe {
            sys::bs_constraint_shift_set(self.pointer(), body.index, compliance, damping_time, message.0.as_mut_ptr(), 256)
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

    pub(super) fn pointer(&self) -> *mut sys::bs_world {
        self.raw.0.as_ptr()
    }

    pub(super) fn usable(&self) -> Result<(), BulletError> {
        if self.broken { Err(BulletError::Broken) } else { Ok(()) }
    }

    pub(super) fn links_of(&self, body: BodyId) -> Result<usize, BulletError> {
        self.usable()?;
        if body.world != self.id {
            return Err(BulletError::ForeignBody);
        }
        Ok(self.link_counts[body.index.unsigned_abs() as usize])
    }

    pub(super) fn one_per_body(&self, body: BodyId, what: &'static str, found: usize) -> Result<(), BulletError> {
        let needed = self.links_of(body)? + 1;
        if found == needed { Ok(()) } else { Err(BulletError::Length { what, found, needed }) }
    }

    pub(super) fn lengths(&self, body: BodyId, arrays: &[(&'static str, usize)]) -> Result<i32, BulletError> {
        let needed = self.links_of(body)?;
        for &(what, found) in arrays {
            if found != needed {
                return Err(BulletError::Length { what, found, needed });
            }
        }
        index(needed)
    }

    /// Turns a code into a result, and marks the world broken where the header says that it is.
    pub(super) fn checked(&mut self, code: i32, message: &Message) -> Result<(), BulletError> {
        let result = outcome(code, || message.text());
        self.broken |= matches!(result, Err(BulletError::Internal(_)));
        result
    }
}
