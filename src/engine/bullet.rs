//! The reference's robot on Bullet, bit for bit.

use super::{ClampHits, Contact, Engine, EngineError, JointState, PlanarBase};
use crate::actuator::PiezoJoint;
use crate::analytic;
use crate::bullet::{self, BaseState, BodyId, BoxLink, Ground, LinkState, Snapshot, SolverSettings, World};
use crate::model::{Extensions, LOSS_TIMES, Mount, Robot, StickSlip};

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
    stable_step: f64,
    step: u64,
    state: JointState,
    links: Vec<LinkState>,
    touching: Vec<bullet::Contact>,
    /// What the joints have beyond eq. 1, if anything.
    beyond: Option<Beyond>,
    clamp_hits: Option<ClampHits>,
}

impl BulletEngine {
    /// Builds `robot`, at rest and flat, to be stepped by `time_step` (s).
    ///
    /// # Errors
    /// [`EngineError::Model`] for a robot that cannot be built, [`EngineError::Bullet`] if Bullet refuses.
    pub fn new(robot: &Robot, time_step: f64) -> Result<Self, EngineError> {
        Self::with_settings(robot, time_step, &SolverSettings::pybullet(robot.material.gravity))
    }

    /// The same with other solver settings.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_settings(robot: &Robot, time_step: f64, settings: &SolverSettings) -> Result<Self, EngineError> {
        robot.check()?;
        let extensions = &robot.extensions;
        for (what, asked) in [
            ("a clamp that gives", extensions.clamp_compliance != 0.0),
            ("a mass fixed to the sheet", !extensions.point_masses.is_empty()),
            ("drag in air", extensions.drag != 0.0),
            ("restitution", extensions.restitution != 0.0),
            ("friction that depends on speed", extensions.stick_slip != StickSlip::OFF),
        ] {
            if asked {
                return Err(EngineError::Unsupported { engine: "bullet", what });
            }
        }
        let mut world = World::new(settings)?;
        if extensions.slope != 0.0 {
            let (sin, cos) = extensions.slope.sin_cos();
            world.set_gravity([-robot.material.gravity * sin, 0.0, -robot.material.gravity * cos])?;
        }
        let boxes = boxes(robot);
        let body = world.add_multibody(&boxes[0], &boxes[1..], [0.0; 3])?;
        match robot.mount {
            Mount::Clamped => world.add_fixed_constraint(body, CLAMP_IMPULSE)?,
            Mount::Ground => {
                world.add_ground(&Ground {
                    half_extents: GROUND_HALF_EXTENTS,
                    top: -0.5 * robot.collision_thickness,
                    friction: robot.friction.ground,
                    collision_margin: COLLISION_MARGIN,
                })?;
            }
            Mount::Free => {}
        }
        let joints = robot.joints();
        let zeros = || vec![0.0; joints];
        Ok(Self {
            world,
            body,
            joint: robot.joint(),
            motors_per_actuator: robot.motors_per_actuator,
            lengths: robot.segments().iter().map(|segment| segment.length).collect(),
            time_step,
            stable_step: analytic::stable_step(robot),
            step: 0,
            state: JointState { angles: zeros(), rates: zeros(), torques: zeros(), motor_voltages: zeros() },
            links: Vec::with_capacity(joints),
            touching: Vec::new(),
            beyond: Beyond::new(robot),
            clamp_hits: None,
        })
    }

    /// The world and the robot's body in it, for looking at contacts and links.
    pub fn world(&mut self) -> (&mut World, BodyId) {
        (&mut self.world, self.body)
    }

    fn not_finite(&self, what: String, value: f64) -> EngineError {
        let time = self.step as f64 * self.time_step;
        EngineError::NotFinite { what, value, step: self.step, time, stable_step: self.stable_step }
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

/// Joints with more to them than eq. 1. Like the torque law it acts with the state of a step's beginning.
struct Beyond {
    extensions: Extensions,
    link: f64,
    /// Rest angle at 0 V of each joint (rad), and factor on its voltage.
    rest_angles: Vec<f64>,
    gains: Vec<f64>,
    /// q_j of the loss ladder of each joint (rad).
    loss: Vec<[f64; LOSS_TIMES.len()]>,
}

impl Beyond {
    fn new(robot: &Robot) -> Option<Self> {
        let e = &robot.extensions;
        if !e.bends_torque_law() && e.rest_curvature.is_empty() && e.joint_gains.is_empty() {
            return None;
        }
        let (joints, m) = (robot.joints(), robot.motors_per_actuator);
        let of_joint = |i: usize| e.rest_curvature.get(i / m).map_or(0.0, |curvature| curvature * robot.link_length());
        Some(Self {
            link: robot.link_length(),
            rest_angles: (0..joints).map(of_joint).collect(),
            gains: (0..joints).map(|i| e.joint_gains.get(i).copied().unwrap_or(1.0)).collect(),
            loss: if e.loss == 0.0 { Vec::new() } else { vec![[0.0; LOSS_TIMES.len()]; joints] },
            extensions: e.clone(),
        })
    }

    /// Torque of joint `i` (dyn·cm); its voltage becomes the one that acts.
    fn torque(&self, i: usize, joint: &PiezoJoint, angle: f64, rate: f64, voltage: &mut f64) -> f64 {
        *voltage *= self.gains[i];
        let angle = angle - self.rest_angles[i];
        let delta = angle - joint.rest_angle_per_volt * *voltage;
        let stored: f64 = self.loss.get(i).map_or(0.0, |ladder| ladder.iter().sum());
        joint.torque(angle, rate, *voltage) + self.extensions.torque(joint.stiffness, self.link, delta, rate)
            - joint.stiffness * self.extensions.loss * stored
    }

    /// Turns the loss ladder on by a step of `dt` (s) at the joints' rates.
    fn remember(&mut self, rates: &[f64], dt: f64) {
        for (ladder, rate) in self.loss.iter_mut().zip(rates) {
            for (q, time) in ladder.iter_mut().zip(LOSS_TIMES) {
                *q += dt * (rate - *q / time);
            }
        }
    }
}

/// The bodies as boxes whose hinges stand in the faces between them.
fn boxes(robot: &Robot) -> Vec<BoxLink> {
    let segments = robot.segments();
    let half_base = 0.5 * segments[0].length;
    let boxes = segments.iter().enumerate().map(|(i, segment)| {
        let half = 0.5 * segment.length;
        // A link's frame stands in its joint, its centre of mass half its length further; the next joint is a whole length from
        // the joint, so as far again from the centre of mass.
        let before = if i == 0 { 0.0 } else { 0.5 * segments[i - 1].length };
        let to_joint = match i {
            0 => 0.0,
            1 => half_base,
            _ => segments[i - 1].length - before,
        };
        BoxLink {
            parent: i.checked_sub(2),
            mass: segment.mass,
            half_extents: [half, 0.5 * robot.material.width, 0.5 * robot.collision_thickness],
            parent_com_to_joint: [to_joint, 0.0, 0.0],
            joint_to_com: [if i == 0 { 0.0 } else { half }, 0.0, 0.0],
            axis: [0.0, 1.0, 0.0],
            friction: segment.friction,
            collision_margin: COLLISION_MARGIN,
        }
    });
    boxes.collect()
}

/// Pitch about +y of a body whose x axis points along (x, y, z) in the world (rad): positive lowers the far end.
///
/// For motion in the plane this is atan2(−z, x). Out of it, where contact has tilted or turned the robot a little, it is the
/// angle to the horizontal, which is what PyBullet's Euler angles give the reference; beyond 90° those fold back and this does not.
fn pitch([x, y, z]: [f64; 3]) -> f64 {
    (-z).atan2(x.hypot(y).copysign(x))
}

/// Pitch of the base, from the first column of its rotation: its x axis in the world.
fn base_pitch(base: &BaseState) -> f64 {
    let [qx, qy, qz, qw] = base.orientation;
    pitch([1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + qw * qz), 2.0 * (qx * qz - qw * qy)])
}

impl Engine for BulletEngine {
    fn prepare(&mut self, voltages: &[f64]) -> Result<(), EngineError> {
        let JointState { angles, rates, torques, motor_voltages } = &mut self.state;
        let beyond = self.beyond.as_ref();
        self.world.joint_states(self.body, angles, rates)?;
        let m = self.motors_per_actuator as f64;
        let mut sum = 0.0;
        for (actuator, &voltage) in voltages.iter().enumerate() {
            let motor_voltage = voltage / m;
            let joints = actuator * self.motors_per_actuator..(actuator + 1) * self.motors_per_actuator;
            for i in joints {
                motor_voltages[i] = motor_voltage;
                torques[i] = match beyond {
                    None => self.joint.torque(angles[i], rates[i], motor_voltage),
                    Some(beyond) => beyond.torque(i, &self.joint, angles[i], rates[i], &mut motor_voltages[i]),
                };
                // Zero for finite values, NaN otherwise: one test per step instead of one per joint.
                sum += 0.0 * angles[i] + 0.0 * rates[i];
            }
        }
        if sum == 0.0 { Ok(()) } else { Err(self.find_not_finite()) }
    }

    fn joints(&self) -> &JointState {
        &self.state
    }

    /// The base's pose is current; the joints' positions, and the right end that hangs on the last of them, come from transforms
    /// that Bullet cached one step earlier. Velocities pair the joints' places with the velocities of the links' centres of mass,
    /// and the right end's takes a whole length of the last body as lever from there. All of this is how the reference records.
    fn nodes(&mut self, positions: &mut [f64], velocities: &mut [f64]) -> Result<(), EngineError> {
        let base = self.world.base_state(self.body)?;
        if let Some(&value) = base.position.iter().chain(&base.velocity).find(|v| !v.is_finite()) {
            return Err(self.not_finite("the base's position or velocity".into(), value));
        }
        self.world.link_states(self.body, &mut self.links)?;
        let p = base_pitch(&base);
        let lever = 0.5 * self.lengths[0];
        let rate = base.angular_velocity[1];
        positions[..3].copy_from_slice(&[base.position[0] - lever * p.cos(), 0.0, base.position[2] + lever * p.sin()]);
        velocities[..3].copy_from_slice(&[
            base.velocity[0] + lever * p.sin() * rate,
            0.0,
            base.velocity[2] + lever * p.cos() * rate,
        ]);

        let joints = self.links.len();
        for (i, link) in self.links.iter().enumerate() {
            // The joint stands half the link's length before its centre of mass, along the link's x axis.
            let to_com = 0.5 * self.lengths[i + 1];
            for axis in 0..3 {
                positions[3 * (i + 1) + axis] = link.position[axis] - link.rotation[axis][0] * to_com;
                velocities[3 * (i + 1) + axis] = link.velocity[axis];
            }
        }

        let last = &self.links[joints - 1];
        let p = pitch([last.rotation[0][0], last.rotation[1][0], last.rotation[2][0]]);
        let length = self.lengths[joints];
        let rate = last.angular_velocity[1];
        let joint = [positions[3 * joints], 0.0, positions[3 * joints + 2]];
        let end = 3 * (joints + 1);
        positions[end..end + 3].copy_from_slice(&[joint[0] + length * p.cos(), 0.0, joint[2] - length * p.sin()]);
        velocities[end..end + 3].copy_from_slice(&[
            last.velocity[0] - length * p.sin() * rate,
            0.0,
            last.velocity[2] - length * p.cos() * rate,
        ]);
        Ok(())
    }

    fn base(&mut self) -> Result<PlanarBase, EngineError> {
        let base = self.world.base_state(self.body)?;
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

    fn advance(&mut self) -> Result<(), EngineError> {
        self.world.set_joint_torques(self.body, &self.state.torques)?;
        self.world.step(self.time_step)?;
        if let Some(beyond) = &mut self.beyond {
            beyond.remember(&self.state.rates, self.time_step);
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
        let mut state: Vec<f64> = self.beyond.iter().flat_map(|beyond| beyond.loss.iter().flatten().copied()).collect();
        state.extend(self.world.snapshot()?.into_vec());
        Ok(state)
    }

    fn load(&mut self, step: u64, state: &[f64]) -> Result<(), EngineError> {
        let memory = self.beyond.as_ref().map_or(0, |beyond| beyond.loss.as_flattened().len());
        let (memory, world) = state.split_at_checked(memory).ok_or(EngineError::State)?;
        self.world.restore(&Snapshot::from_vec(world.to_vec()))?;
        if let Some(beyond) = &mut self.beyond {
            beyond.loss.as_flattened_mut().copy_from_slice(memory);
        }
        self.step = step;
        Ok(())
    }

    fn step(&self) -> u64 {
        self.step
    }

    fn clamp_hits(&self) -> Option<ClampHits> {
        self.clamp_hits
    }
}
