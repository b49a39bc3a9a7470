//! The reference's robot on Bullet, bit for bit, and the extensions of the model.
//!
//! # Extensions
//!
//! Without extensions the robot is the reference's, and none of this is computed. With them:
//!
//! - Joint torques ([`JointExtensions`]), drag in air ([`Air`]), tapes and cables ([`Attachments`]) and friction that depends on speed ([`Sliding`]) act like the torque law: with
//!   the state at the step's start, an error of first order in the step. Only the Prony chains have a memory; it is part of saved states.
//! - A point mass changes mass, centre of mass and inertia of the body it is fixed to, exactly. Records stay those of the boxes.
//! - A compliant clamp is a spring at the left end, in the constraint that holds the base. It is implicit, so any compliance is stable at any step; its
//!   numerical damping, a ratio of ω h/2 on the clamp's share of a mode's energy, is of first order in the step. So is a clamp that shifts. A clamp whose turn
//!   is a curve of the moment is linearised there at the step's start, a further error of first order.
//! - Restitution is Bullet's, with its threshold of 0.2 cm/s, without the push-out of the overlap that Bullet adds. The approach speed includes what the
//!   step's forces add, so a foot that the actuators press down by more than 0.2 cm/s per step trembles; the planar engine takes the speed at the step's start.

mod air;
mod attachment;
mod geometry;
mod joint_extensions;
mod sliding;

use self::air::Air;
use self::attachment::Attachments;
use self::geometry::{add, base_pitch, boxes, cross, pitch, rotation};
use self::joint_extensions::JointExtensions;
use self::sliding::Sliding;
use super::{ClampHits, Contact, Engine, EngineError, JointState, PlanarBase, Posed};
use crate::actuator::PiezoJoint;
use crate::analytic;
use crate::bullet::{self, BaseState, BodyId, Ground, LinkState, Snapshot, SolverSettings, World, Wrench};
use crate::model::{Mount, Robot};

/// Collision margin of every box (cm), as PyBullet sets it for bodies built by its calls.
const COLLISION_MARGIN: f64 = 0.001;
/// Half extents of the reference's floor (cm): its plane.urdf, scaled by ten.
const GROUND_HALF_EXTENTS: [f64; 3] = [1000.0, 1000.0, 50.0];
/// Largest impulse of the clamp's constraint (dyn·s), PyBullet's default.
const CLAMP_IMPULSE: f64 = 500.0;

/// A chain of boxes in a world with the reference's solver settings.
///
/// Built in the reference's order, because that decides the order of contacts and so the last bits: the chain, then for
/// [`Mount::Clamped`] the constraint that holds its base, for [`Mount::Ground`] the floor.
pub struct BulletEngine {
    world: World,
    body: BodyId,
    joint: PiezoJoint,
    motors_per_actuator: usize,
    lengths: Vec<f64>,
    time_step: f64,
    /// For messages.
    robot: Robot,
    step: u64,
    state: JointState,
    links: Vec<LinkState>,
    touching: Vec<bullet::Contact>,
    extensions: Option<JointExtensions>,
    air: Option<Air>,
    attachments: Option<Attachments>,
    sliding: Option<Sliding>,
    /// Motions of the boxes and wrenches on them, for what acts from outside.
    boxes: Vec<LinkState>,
    wrenches: Vec<Wrench>,
    /// From each body's centre of mass to its box's centre, along the body (cm); empty if they are the same.
    com_to_box: Vec<f64>,
    clamp_hits: Option<ClampHits>,
}

impl BulletEngine {
    /// Builds `robot`, at rest and flat, to be stepped by `time_step` (s).
    ///
    /// # Errors
    /// [`EngineError::Model`] for a robot that cannot be built, [`EngineError::TimeStep`], [`EngineError::Bullet`] if Bullet refuses.
    pub fn new(robot: &Robot, time_step: f64) -> Result<Self, EngineError> {
        Self::with_settings(robot, time_step, &SolverSettings::pybullet(robot.material.gravity))
    }

    /// [`new`](Self::new) with other solver settings.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_settings(robot: &Robot, time_step: f64, settings: &SolverSettings) -> Result<Self, EngineError> {
        robot.check()?;
        EngineError::unless_step(time_step)?;
        let extensions = &robot.extensions;
        let mut world = World::new(settings)?;
        if extensions.slope != 0.0 {
            let (sin, cos) = extensions.slope.sin_cos();
            world.set_gravity([-robot.material.gravity * sin, 0.0, -robot.material.gravity * cos])?;
        }
        let (segments, bodies) = (robot.segments(), robot.rigid_bodies());
        let sliding = Sliding::new(robot);
        let boxes = boxes(robot, sliding.as_ref());
        // The base's box stands at the origin.
        let com_to_box: Vec<f64> = boxes.iter().map(|link| link.com_to_box[0]).collect();
        let body = world.add_multibody(&boxes[0], &boxes[1..], [0.0 - com_to_box[0], 0.0, 0.0])?;
        let left_end = [-bodies[0].middle * segments[0].length, 0.0, 0.0];
        match (robot.mount, extensions.curved_clamp()) {
            (Mount::Clamped, Some(curve)) => {
                let (width, damping) = (curve.width(), extensions.clamp_damping);
                // A turn about y lowers the free end, which is negative for the curve.
                let mut compliances = curve.compliances();
                compliances.reverse();
                world.add_bent_constraint(body, left_end, width, compliances, damping, CLAMP_IMPULSE)?;
            }
            (Mount::Clamped, None) if extensions.clamp_compliance > 0.0 => {
                world.add_sprung_constraint(
                    body,
                    left_end,
                    extensions.clamp_compliance,
                    extensions.clamp_damping,
                    extensions.clamp_hardening,
                    CLAMP_IMPULSE,
                )?;
            }
            (Mount::Clamped, None) => world.add_fixed_constraint(body, CLAMP_IMPULSE)?,
            (Mount::Ground, _) => {
                world.add_ground(&Ground {
                    half_extents: GROUND_HALF_EXTENTS,
                    top: -0.5 * robot.collision_thickness,
                    // Bullet multiplies the coefficients of both bodies. Where the robot's is set in every step, the floor's is 1; so is its restitution.
                    friction: if sliding.is_some() { 1.0 } else { robot.friction.ground },
                    restitution: 1.0,
                    collision_margin: COLLISION_MARGIN,
                })?;
            }
            (Mount::Free, _) => {}
        }
        if robot.mount == Mount::Clamped && extensions.clamp_shift > 0.0 {
            world.set_constraint_shift(body, extensions.clamp_shift, extensions.clamp_shift_damping)?;
        }
        let joints = robot.joints();
        let zeros = || vec![0.0; joints];
        Ok(Self {
            world,
            body,
            joint: robot.joint(),
            motors_per_actuator: robot.motors_per_actuator,
            lengths: segments.iter().map(|segment| segment.length).collect(),
            time_step,
            robot: robot.clone(),
            step: 0,
            state: JointState { angles: zeros(), rates: zeros(), torques: zeros(), motor_voltages: zeros() },
            links: Vec::with_capacity(joints),
            touching: Vec::new(),
            extensions: JointExtensions::new(robot),
            air: Air::new(robot),
            attachments: Attachments::new(robot, time_step),
            sliding,
            boxes: Vec::with_capacity(bodies.len()),
            wrenches: vec![Wrench::default(); bodies.len()],
            com_to_box: if com_to_box.iter().any(|&by| by != 0.0) { com_to_box } else { Vec::new() },
            clamp_hits: None,
        })
    }

    /// Sets Bullet's limit on every velocity of the robot (cm/s of the base, rad/s of base and joints), 100 in the reference.
    ///
    /// # Errors
    /// [`EngineError::Bullet`] unless it is positive and finite.
    pub fn set_velocity_limit(&mut self, limit: f64) -> Result<(), EngineError> {
        Ok(self.world.set_velocity_clamp(self.body, limit)?)
    }

    /// The world and the robot's body in it, for looking at contacts and links.
    pub fn world(&mut self) -> (&mut World, BodyId) {
        (&mut self.world, self.body)
    }

    /// Pose and velocity of the base's box.
    fn base_state(&self) -> Result<BaseState, EngineError> {
        let mut base = self.world.base_state(self.body)?;
        if let Some(&by) = self.com_to_box.first() {
            let arm = rotation(&base).map(|row| row[0] * by);
            add(&mut base.position, arm);
            add(&mut base.velocity, cross(base.angular_velocity, arm));
        }
        Ok(base)
    }

    /// Reads pose and velocity of the links' boxes.
    fn read_links(&mut self) -> Result<(), EngineError> {
        self.world.link_states(self.body, &mut self.links)?;
        for (link, &by) in self.links.iter_mut().zip(self.com_to_box.iter().skip(1)) {
            let arm = link.rotation.map(|row| row[0] * by);
            add(&mut link.position, arm);
            add(&mut link.velocity, cross(link.angular_velocity, arm));
        }
        Ok(())
    }

    /// Reads the links' boxes, and the base's, which must be numbers.
    fn read_bodies(&mut self) -> Result<BaseState, EngineError> {
        let base = self.base_state()?;
        if let Some(&value) = base.position.iter().chain(&base.velocity).find(|v| !v.is_finite()) {
            return Err(self.not_finite("the base's position or velocity".into(), value));
        }
        self.read_links()?;
        Ok(base)
    }

    /// Calls `put` with index and position (cm) of every node, from the links last read; returns the pitch of the last body (rad).
    fn place_nodes(&self, base: &BaseState, mut put: impl FnMut(usize, [f64; 3])) -> f64 {
        let p = base_pitch(base);
        let lever = 0.5 * self.lengths[0];
        put(0, [base.position[0] - lever * p.cos(), 0.0, base.position[2] + lever * p.sin()]);
        let mut joint = [0.0; 3];
        for (i, link) in self.links.iter().enumerate() {
            // The joint stands half the link's length before its centre of mass, along the link's x axis.
            let to_com = 0.5 * self.lengths[i + 1];
            joint = std::array::from_fn(|axis| link.position[axis] - link.rotation[axis][0] * to_com);
            put(i + 1, joint);
        }
        let joints = self.links.len();
        let last = &self.links[joints - 1];
        let p = pitch([last.rotation[0][0], last.rotation[1][0], last.rotation[2][0]]);
        let length = self.lengths[joints];
        put(joints + 1, [joint[0] + length * p.cos(), 0.0, joint[2] - length * p.sin()]);
        p
    }

    /// Sets drag, the forces of what is fixed to the sheet, viscous friction and the coefficients of friction of the coming step.
    fn apply_surroundings(&mut self) -> Result<(), EngineError> {
        if self.air.is_none() && self.attachments.is_none() && self.sliding.is_none() {
            return Ok(());
        }
        let base = self.base_state()?;
        self.read_links()?;
        self.boxes.clear();
        self.boxes.push(LinkState {
            position: base.position,
            rotation: rotation(&base),
            velocity: base.velocity,
            angular_velocity: base.angular_velocity,
        });
        self.boxes.extend_from_slice(&self.links);
        self.wrenches.fill(Wrench::default());
        if let Some(air) = &self.air {
            air.push(&self.boxes, &mut self.wrenches);
        }
        if let Some(attachments) = &self.attachments {
            attachments.push(&self.boxes, &mut self.wrenches);
        }
        if let Some(sliding) = &mut self.sliding {
            sliding.push(&self.boxes, &mut self.wrenches);
            self.world.set_frictions(self.body, sliding.frictions(&self.boxes))?;
        }
        // Move the forces from the boxes' centres to the centres of mass.
        for ((wrench, body), &by) in self.wrenches.iter_mut().zip(&self.boxes).zip(&self.com_to_box) {
            add(&mut wrench.torque, cross(body.rotation.map(|row| row[0] * by), wrench.force));
        }
        Ok(self.world.add_forces(self.body, &self.wrenches)?)
    }

    fn not_finite(&self, what: String, value: f64) -> EngineError {
        let time = self.step as f64 * self.time_step;
        EngineError::NotFinite { what, value, step: self.step, time, stable_step: Some(analytic::stable_step(&self.robot)) }
    }

    /// The first joint whose angle or rate is not a number. Kept out of the loop: it runs once per failure.
    #[cold]
    fn find_not_finite(&self) -> EngineError {
        let JointState { angles, rates, .. } = &self.state;
        for (i, (&angle, &rate)) in angles.iter().zip(rates).enumerate() {
            for (what, value) in [("the angle", angle), ("the rate", rate)] {
                if !value.is_finite() {
                    return self.not_finite(format!("{what} of joint {}", i + 1), value);
                }
            }
        }
        self.not_finite("a joint".into(), f64::NAN)
    }
}

impl Engine for BulletEngine {
    fn prepare(&mut self, voltages: &[f64]) -> Result<(), EngineError> {
        EngineError::unless_voltages(voltages.len(), self.robot.actuators)?;
        let JointState { angles, rates, torques, motor_voltages } = &mut self.state;
        let mut extensions = self.extensions.as_mut();
        self.world.joint_states(self.body, angles, rates)?;
        let m = self.motors_per_actuator as f64;
        let mut sum = 0.0;
        for (actuator, &voltage) in voltages.iter().enumerate() {
            let motor_voltage = voltage / m;
            let joints = actuator * self.motors_per_actuator..(actuator + 1) * self.motors_per_actuator;
            for i in joints {
                motor_voltages[i] = motor_voltage;
                torques[i] = match &mut extensions {
                    None => self.joint.torque(angles[i], rates[i], motor_voltage),
                    Some(extensions) => extensions.torque(i, &self.joint, angles[i], rates[i], &mut motor_voltages[i]),
                };
                // Zero for finite values, NaN otherwise: one test per step instead of one per joint.
                sum += 0.0 * angles[i] + 0.0 * rates[i];
            }
        }
        if sum == 0.0 { Ok(()) } else { Err(self.find_not_finite()) }
    }

    fn joints(&mut self) -> &JointState {
        &self.state
    }

    /// The base's pose is current; the joints' positions, and the right end that hangs on the last of them, come from transforms
    /// that Bullet cached one step earlier. Velocities pair the joints' places with the velocities of the links' centres of mass,
    /// and the right end's takes a whole length of the last body as lever from there. All of this is how the reference records.
    fn nodes(&mut self, positions: &mut [f64], velocities: &mut [f64]) -> Result<(), EngineError> {
        for (what, given) in [("the nodes' positions", positions.len()), ("the nodes' velocities", velocities.len())] {
            EngineError::unless_length(what, given, 3 * (self.lengths.len() + 1))?;
        }
        let base = self.read_bodies()?;
        let last = self.place_nodes(&base, |node, place| positions[3 * node..3 * node + 3].copy_from_slice(&place));
        let p = base_pitch(&base);
        let lever = 0.5 * self.lengths[0];
        let rate = base.angular_velocity[1];
        velocities[..3].copy_from_slice(&[
            base.velocity[0] + lever * p.sin() * rate,
            0.0,
            base.velocity[2] + lever * p.cos() * rate,
        ]);
        for (i, link) in self.links.iter().enumerate() {
            velocities[3 * (i + 1)..3 * (i + 2)].copy_from_slice(&link.velocity);
        }
        let joints = self.links.len();
        let LinkState { velocity, angular_velocity, .. } = &self.links[joints - 1];
        let (length, rate) = (self.lengths[joints], angular_velocity[1]);
        velocities[3 * (joints + 1)..3 * (joints + 2)].copy_from_slice(&[
            velocity[0] - length * last.sin() * rate,
            0.0,
            velocity[2] - length * last.cos() * rate,
        ]);
        Ok(())
    }

    /// From the base's motion and the joints' angles and rates, which are all of the same time, by the chain's geometry in its plane.
    fn correct_velocities(&mut self, velocities: &mut [f64]) -> Result<(), EngineError> {
        let PlanarBase { mut pitch, pitch_rate: mut rate, velocity: [x, z], .. } = self.base()?;
        let lever = |length: f64, pitch: f64, rate: f64| [-length * pitch.sin() * rate, -length * pitch.cos() * rate];
        let [lever_x, lever_z] = lever(-0.5 * self.lengths[0], pitch, rate);
        let mut velocity = [x + lever_x, z + lever_z];
        for (i, node) in velocities.chunks_exact_mut(3).enumerate() {
            if i > 0 {
                let [lever_x, lever_z] = lever(self.lengths[i - 1], pitch, rate);
                velocity = [velocity[0] + lever_x, velocity[1] + lever_z];
                // Behind a joint. The right end has none.
                pitch += self.state.angles.get(i - 1).unwrap_or(&0.0);
                rate += self.state.rates.get(i - 1).unwrap_or(&0.0);
            }
            node.copy_from_slice(&[velocity[0], 0.0, velocity[1]]);
        }
        Ok(())
    }

    fn places(&mut self, nodes: &mut [[f64; 2]]) -> Result<(), EngineError> {
        EngineError::unless_length("the nodes' places", nodes.len(), self.lengths.len() + 1)?;
        let base = self.read_bodies()?;
        self.place_nodes(&base, |node, [x, _, z]| nodes[node] = [x, z]);
        Ok(())
    }

    fn motor_voltages(&self) -> &[f64] {
        &self.state.motor_voltages
    }

    fn base(&mut self) -> Result<PlanarBase, EngineError> {
        let base = self.base_state()?;
        let plane = |v: [f64; 3]| [v[0], v[2]];
        Ok(PlanarBase {
            position: plane(base.position),
            pitch: base_pitch(&base),
            velocity: plane(base.velocity),
            pitch_rate: base.angular_velocity[1],
        })
    }

    fn contacts(&mut self, contacts: &mut Vec<Contact>) -> Result<(), EngineError> {
        self.world.contacts(&mut self.touching)?;
        contacts.clear();
        contacts.extend(self.touching.iter().filter(|c| c.normal_impulse != 0.0).map(|c| {
            // Impulses are those on the first body.
            let (sign, link) = if c.a.0 == self.body { (1.0, c.a.1) } else { (-1.0, c.b.1) };
            let along = |axis: usize| {
                let friction = c.friction_impulse[0] * c.friction_directions[0][axis]
                    + c.friction_impulse[1] * c.friction_directions[1][axis];
                sign * (c.normal_impulse * c.normal[axis] + friction) / self.time_step
            };
            Contact {
                link: link.map_or(0, |link| link + 1),
                position: [c.position[0], c.position[2]],
                force: [along(0), along(2)],
            }
        }));
        Ok(())
    }

    fn set_joint_angles(&mut self, robot: &Robot, angles: &[f64]) -> Result<(), EngineError> {
        let posed = Posed::new(robot, angles)?;
        self.world.set_joint_states(self.body, angles, &vec![0.0; angles.len()])?;
        let mut base = self.world.base_state(self.body)?;
        base.position[2] += posed.lift;
        Ok(self.world.set_base_state(self.body, &base)?)
    }

    fn advance(&mut self) -> Result<(), EngineError> {
        self.apply_surroundings()?;
        self.world.set_joint_torques(self.body, &self.state.torques)?;
        self.world.step(self.time_step)?;
        if let Some(extensions) = &mut self.extensions {
            extensions.advance(&self.state.rates, self.time_step);
        }
        let clamp = self.world.velocity_clamp(self.body)?;
        if clamp.hit() {
            let hits = self.clamp_hits.get_or_insert(ClampHits { steps: 0, first_step: self.step, limit: clamp.limit });
            hits.steps += 1;
        }
        self.step += 1;
        Ok(())
    }

    fn save(&self) -> Result<Vec<f64>, EngineError> {
        let mut state: Vec<f64> = self.extensions.iter().flat_map(|extensions| extensions.memory.iter().copied()).collect();
        state.extend(self.world.snapshot()?.into_vec());
        Ok(state)
    }

    fn load(&mut self, step: u64, state: &[f64]) -> Result<(), EngineError> {
        let memory = self.extensions.as_ref().map_or(0, |extensions| extensions.memory.len());
        let (memory, world) = state.split_at_checked(memory).ok_or(EngineError::State)?;
        self.world.restore(&Snapshot::from_vec(world.to_vec()))?;
        if let Some(extensions) = &mut self.extensions {
            extensions.memory.copy_from_slice(memory);
        }
        self.step = step;
        Ok(())
    }

    fn actuators(&self) -> usize {
        self.robot.actuators
    }

    fn step(&self) -> u64 {
        self.step
    }

    fn hardening_curvature(&self) -> f64 {
        self.extensions.as_ref().map_or(0.0, |extensions| extensions.largest / extensions.link)
    }

    fn clamp_hits(&self) -> Option<ClampHits> {
        self.clamp_hits
    }
}
