//! The same robot in the plane: springs and dampers implicit, contact as a convex problem, every step linear in the number of links.
//!
//! # Scheme
//!
//! The state is the angle φ of every body, the centre of mass, and the absolute velocities V of all bodies (rate, and velocity of the centre
//! of mass). A step of length h solves for the mean motion u of the joints and the floating base,
//!
//! ```text
//! Jᵀ M (J u − V) + w h (k (h/2 + η)) u = w h (τ(θ) + gravity) + w λ,      V⁺ = V + (J u − V)/w,      φ⁺ = φ + h u
//! ```
//!
//! with the velocities J at the pose that the old rates lead to in the middle of the step. Springs, dampers and drives act at that middle. M
//! is constant, for V are the bodies' own velocities; k and η are diagonal in the joints, so they only add to each joint's articulated
//! inertia, and the articulated-body recursion solves a step in one walk down the chain and one back ([`recursion`]).
//!
//! With w = 1/2 this is the midpoint rule: of second order where nothing touches, stable at any step, and it makes no energy, whatever the
//! pose in J: V⁺ᵀMV⁺ − VᵀMV = 2 h u·(forces), springs give back what they took, and of a robot that is not clamped gravity does too, for
//! its height is the centre of mass's own coordinate. (A clamped robot's gravity closes to third order in h per step.) w is a little more than 1/2, see
//! [`NUMERICAL_DAMPING`]; what that takes is known and on the books.
//!
//! # Contact
//!
//! The two bottom corners of every box may touch the floor. In velocities v⁺ at the end of the step, with a look-ahead of one step,
//!
//! ```text
//! 0 ≤ v_n⁺ + gap/h  ⊥  λ_n ≥ 0,        |λ_t| ≤ μ λ_n
//! ```
//!
//! so a corner never passes the floor: it stops on it, without bounce. Friction is the convex model of Anitescu: its minimum is unique, and
//! sliding lifts a corner by μ·h·|v_t|, which vanishes with the step. [`FrictionModel::Coulomb`] takes that lift off again by a damped
//! fixed-point iteration over such problems (De Saxcé). Newton's method over the corners' states (open, sticking, sliding) puts active
//! corners into the recursion as terms of their bodies' inertia.
//!
//! # References
//!
//! R. Featherstone, *Rigid Body Dynamics Algorithms*, chapter 7 (articulated bodies). D. E. Stewart and J. C. Trinkle, Int. J. Numer. Meth.
//! Eng. 39 (1996) (time stepping with complementarity). M. Anitescu, Math. Program. 105 (2006) (the convex model). A. Castro et al., arXiv
//! 2110.10107 (regularised cones and Newton's method).

mod beyond;
mod contact;
mod floor;
mod newton;
mod recursion;
mod statics;

use wide::f64x2;

pub(super) use self::beyond::GAUSS;
use self::beyond::{Beyond, LARGEST_REPETITIONS};
use self::contact::Law;
use self::floor::{Floor, Inwards, Surface};
use self::recursion::{Hold, Rung, Spatials, direction, solve};
use super::{ClampHits, Contact, Engine, EngineError, JointState, PlanarBase};
use crate::actuator::PiezoJoint;
use crate::analytic;
use crate::model::{Mount, Robot};

/// Bullet's limit on the product of two friction coefficients, kept for equal friction.
pub(super) const LARGEST_FRICTION: f64 = 10.0;
/// The weight of a step's end over that of its start is 1/2 + this (1/s) times the step, so that what alternates from step to step dies out:
/// a velocity that springs and dampers dictate keeps −(1 − w)/w of an alternation per step. For a mode of angular frequency ω this adds
/// h (w − 1/2) ω/2 to the damping ratio, of second order in h.
const NUMERICAL_DAMPING: f64 = 50.0;
/// The links' directions are computed anew every so many steps, for turning them on loses a last digit at times.
const EXACT_EVERY: u64 = 256;

/// How sliding corners are treated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FrictionModel {
    /// One convex problem a step. Sliding lifts a corner by μ·h·|v_t|, so that gaits need steps of 10⁻⁶ s where friction is high.
    #[default]
    Convex,
    /// Coulomb's law, by repeating the step until nothing is lifted: several times the work, for steps a hundred times as long.
    Coulomb,
}

/// The robot as a planar chain.
pub struct PlanarEngine {
    joint: PiezoJoint,
    motors_per_actuator: usize,
    mount: Mount,
    hold: Hold,
    /// Rest angle of each joint at 0 V (rad) and factor on its voltage, where there are such.
    rest_angles: Vec<f64>,
    gains: Vec<f64>,
    beyond: Option<Beyond>,
    time_step: f64,
    stable_step: f64,
    gravity: f64,
    /// Along x and z (cm/s²).
    pull: [f64; 2],
    mass: f64,
    /// Number of bodies, and which one is the root.
    count: usize,
    root: usize,
    lengths: Vec<f64>,
    rungs: Vec<Rung>,
    /// Directions put aside while others are looked at.
    kept: Vec<[f64x2; 2]>,
    /// Centre of mass (cm) and its velocity (cm/s). A clamped chain has its left end here.
    centre: [f64; 2],
    velocity: [f64; 2],
    /// None but for robots on the ground.
    floor: Option<Box<Floor>>,
    friction: FrictionModel,
    /// Mean motions of the reference points in the iterate of the contact problem.
    iterate: Vec<Spatials>,
    law: Law,
    weight: f64,
    step: u64,
    /// What was last asked for of the joints, but for the voltages, which are always those of [`prepare`](Engine::prepare).
    state: JointState,
    /// The actuators' voltages of the last [`prepare`](Engine::prepare) (V).
    voltages: Vec<f64>,
    /// Whether the state is known to be numbers, because the changes of the last step were.
    finite: bool,
    /// Of all steps, for the books of energy.
    turns: [f64; 2],
    /// Newton iterations so far, of all steps.
    iterations: u64,
    /// Energy that the weight of the step's end has taken so far (erg).
    numerical_loss: f64,
}

impl PlanarEngine {
    /// Builds `robot`, at rest and flat, to be stepped by `time_step` (s).
    ///
    /// # Errors
    /// [`EngineError::Model`] for a robot that cannot be built, [`EngineError::StepTooLong`].
    pub fn new(robot: &Robot, time_step: f64) -> Result<Self, EngineError> {
        Self::with_numerical_damping(robot, time_step, NUMERICAL_DAMPING)
    }

    /// The same with another weight of the step's end: ½ + `damping` (1/s) times the step. Less is more exact for a robot that touches nothing.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_numerical_damping(robot: &Robot, time_step: f64, damping: f64) -> Result<Self, EngineError> {
        robot.check()?;
        let longest = 0.1 / (analytic::cantilever_frequency(robot) * (robot.actuators as f64).powi(2));
        if time_step.is_nan() || time_step > longest {
            return Err(EngineError::StepTooLong { time_step, longest });
        }
        let segments = robot.segments();
        let count = segments.len();
        let joint = robot.joint();
        let thickness = robot.collision_thickness;
        let extensions = &robot.extensions;
        let bodies = robot.rigid_bodies();
        let mass: f64 = bodies.iter().map(|body| body.mass).sum();
        let weight = (0.5 + damping * time_step).min(1.0);
        let implicit = weight * time_step * joint.stiffness * (joint.damping_time + 0.5 * time_step);
        let clamped = robot.mount == Mount::Clamped;
        let root = if clamped { 0 } else { count / 2 };
        let mut rungs = vec![Rung::empty(); root.max(count - 1 - root) + 1];
        let mut frictions = vec![[0.0; 2]; rungs.len()];
        for (i, segment) in segments.iter().enumerate() {
            let (rung, lane) = place(i, root);
            let at = &mut rungs[rung];
            put(&mut at.mass, lane, bodies[i].mass);
            put(&mut at.share, lane, bodies[i].mass / mass);
            put(&mut at.inertia, lane, bodies[i].inertia);
            put(&mut at.middle, lane, if i < root { 1.0 - bodies[i].middle } else { bodies[i].middle });
            put(&mut at.reach, lane, if i < root { -segment.length } else { segment.length });
            put(&mut at.stiffness, lane, joint.stiffness);
            put(&mut at.implicit, lane, implicit);
            frictions[rung][lane] = (segment.friction * robot.friction.ground).min(LARGEST_FRICTION);
        }
        for rung in &mut rungs {
            let half = rung.middle * rung.reach;
            rung.inertia_at_reference = rung.inertia + rung.mass * half * half;
        }
        hang_levers(&mut rungs);
        // The base's centre stands at the origin, as in Bullet.
        let left = -0.5 * segments[0].length;
        let (mut at, mut moment) = (left, 0.0);
        for (segment, body) in segments.iter().zip(&bodies) {
            moment += body.mass * (at + body.middle * segment.length);
            at += segment.length;
        }
        let hold = match robot.mount {
            Mount::Clamped if extensions.clamp_compliance > 0.0 => Hold::Hinged,
            Mount::Clamped => Hold::Clamped,
            _ => Hold::Free,
        };
        if hold == Hold::Hinged {
            let stiffness = 1.0 / extensions.clamp_compliance;
            put(&mut rungs[0].stiffness, 0, stiffness);
            put(&mut rungs[0].implicit, 0, weight * time_step * stiffness * 0.5 * time_step);
        }
        let m = robot.motors_per_actuator;
        let rest_angles =
            extensions.rest_curvature.iter().flat_map(|curvature| vec![curvature * robot.link_length(); m]).collect();
        let joints = || vec![0.0; count - 1];
        Ok(Self {
            joint,
            motors_per_actuator: robot.motors_per_actuator,
            mount: robot.mount,
            hold,
            rest_angles,
            gains: extensions.joint_gains.clone(),
            beyond: Beyond::new(extensions, robot.material.width, robot.link_length(), time_step, &rungs),
            time_step,
            stable_step: analytic::stable_step(robot),
            gravity: robot.material.gravity,
            pull: pull(robot.material.gravity, extensions.slope),
            mass,
            count,
            root,
            lengths: segments.iter().map(|segment| segment.length).collect(),
            kept: vec![[f64x2::ZERO; 2]; rungs.len()],
            centre: if clamped { [left, 0.0] } else { [moment / mass, 0.0] },
            velocity: [0.0; 2],
            floor: (robot.mount == Mount::Ground)
                .then(|| Box::new(Floor::new(&frictions, 0.5 * thickness, Surface::new(extensions)))),
            friction: FrictionModel::default(),
            iterate: vec![Spatials::default(); rungs.len()],
            rungs,
            law: Law::new(time_step, weight, mass / count as f64),
            weight,
            step: 0,
            state: JointState { angles: joints(), rates: joints(), torques: joints(), motor_voltages: joints() },
            voltages: Vec::with_capacity(robot.actuators),
            finite: false,
            turns: [0.0; 2],
            iterations: 0,
            numerical_loss: 0.0,
        })
    }

    /// Contact problems' Newton iterations over all steps so far; 0 for steps without contact.
    pub fn iterations(&self) -> u64 {
        self.iterations
    }

    /// Chooses how sliding corners are treated.
    pub fn set_friction_model(&mut self, friction: FrictionModel) {
        self.friction = friction;
    }

    /// Lets the floor rise by `angle` (rad) along +x: in its axes gravity is g (−sin, −cos). The books of energy know level floors only.
    pub fn set_slope(&mut self, angle: f64) {
        self.pull = pull(self.gravity, angle);
    }

    fn clamped(&self) -> bool {
        self.mount == Mount::Clamped
    }

    /// One number of body `i`.
    fn of_body(&self, i: usize, what: impl Fn(&Rung) -> f64x2) -> f64 {
        let (rung, lane) = place(i, self.root);
        what(&self.rungs[rung]).as_array()[lane]
    }

    /// Turns the links to where they are in the middle of the step if all goes on at its rates, and loads there what is known of the step's
    /// right side: momenta, gravity, drag and the joints' torques for `share` (s).
    fn begin_step(&mut self, share: f64) {
        let ahead = f64x2::splat(0.5 * self.time_step);
        let exact = self.step.is_multiple_of(EXACT_EVERY);
        let pull = self.pull.map(|part| f64x2::splat(share * part));
        let share = f64x2::splat(share);
        let drag = self.beyond.as_ref().filter(|beyond| beyond.has_drag());
        let mut inner = f64x2::ZERO;
        for (k, rung) in self.rungs.iter_mut().enumerate() {
            rung.turn_to(rung.angle + ahead * rung.motion[0], exact);
            rung.load_torque(-share, inner);
            inner = outwards(rung.angle, k);
            let [rate, x, z] = rung.motion;
            let mut momentum = [rung.inertia * rate, rung.mass * (x + pull[0]), rung.mass * (z + pull[1])];
            if let Some(beyond) = drag {
                let drag = beyond.drag(rung);
                (0..3).for_each(|k| momentum[k] += share * drag[k]);
            }
            rung.load(momentum);
        }
    }

    /// Shows `look` the links as they stand now.
    fn posed<T>(&mut self, look: impl FnOnce(&Self) -> T) -> T {
        for (rung, kept) in self.rungs.iter_mut().zip(&mut self.kept) {
            *kept = rung.along;
            rung.along = direction(rung.angle);
            rung.lay();
        }
        let seen = look(self);
        for (rung, kept) in self.rungs.iter_mut().zip(&self.kept) {
            rung.along = *kept;
            rung.lay();
        }
        seen
    }

    /// Where the root's reference point is (cm), as the links are turned, and its velocity (cm/s), from the rates and the velocity of the
    /// centre of mass.
    fn root_motion(&self) -> ([f64; 2], [f64; 2]) {
        if self.clamped() {
            return (self.centre, [0.0; 2]);
        }
        let (mut position, mut velocity) = ([f64x2::ZERO; 2], [f64x2::ZERO; 2]);
        for rung in &self.rungs {
            let [x, z] = rung.along.map(|along| rung.lever * along);
            position = [position[0] + x, position[1] + z];
            velocity = [velocity[0] - rung.motion[0] * z, velocity[1] + rung.motion[0] * x];
        }
        let sum = |of: [f64x2; 2], from: [f64; 2]| [0, 1].map(|k| from[k] - of[k].reduce_add());
        (sum(position, self.centre), sum(velocity, self.velocity))
    }

    /// Height of a free robot's root (cm) in the middle of the step, as the links are turned, and its velocity at the start.
    fn root_over_floor(&self) -> (f64, [f64; 2]) {
        let ([_, height], velocity) = self.root_motion();
        (height + 0.5 * self.time_step * self.velocity[1], velocity)
    }

    /// Position and velocity of the left end of the chain, as the links are turned, with the state's velocities.
    fn left_end(&self) -> ([f64; 2], [f64; 2]) {
        let (mut position, mut velocity) = self.root_motion();
        // The left arm's other ends are left ends.
        for rung in self.rungs.iter().skip(1) {
            if rung.mass.to_array()[0] > 0.0 {
                let [x, z] = rung.across.map(|part| part.to_array()[0]);
                let rate = rung.motion[0].to_array()[0];
                position = [position[0] + x, position[1] + z];
                velocity = [velocity[0] - rate * z, velocity[1] + rate * x];
            }
        }
        (position, velocity)
    }

    /// Body `i` from its left end to its right one (cm).
    fn body_vector(&self, i: usize) -> [f64; 2] {
        [0, 1].map(|k| self.lengths[i] * self.of_body(i, |rung| rung.along[k]))
    }

    /// Solves the step's mean motion, again and again where joints rub.
    fn solve_step(&mut self, share: f64) -> Result<(), EngineError> {
        let Some(mut beyond) = self.beyond.take() else { return self.solve_once() };
        beyond.begin(&self.rungs);
        let mut result = Ok(());
        for repetition in 1..=LARGEST_REPETITIONS {
            beyond.load(&mut self.rungs, share);
            result = self.solve_once();
            if result.is_err() || beyond.accept(&self.rungs) || !beyond.is_repeated() {
                break;
            }
            if repetition == LARGEST_REPETITIONS {
                let time = self.step as f64 * self.time_step;
                result = Err(EngineError::NotConverged { iterations: repetition, step: self.step, time });
            }
        }
        beyond.end();
        self.beyond = Some(beyond);
        result
    }

    fn solve_once(&mut self) -> Result<(), EngineError> {
        let law = self.law;
        if !self.solve_on_floor(&law)? {
            solve(&mut self.rungs, self.hold, Inwards::default(), &law);
        }
        Ok(())
    }

    /// Sets the joints' voltages and rest angles, if the actuators' `voltages` are not those of the step before.
    fn apply(&mut self, voltages: &[f64]) {
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        if self.voltages.len() == voltages.len() && self.voltages.iter().zip(voltages).all(same) {
            return;
        }
        self.voltages.clear();
        self.voltages.extend_from_slice(voltages);
        let m = self.motors_per_actuator;
        let state = &mut self.state;
        for (joints, volts) in state.motor_voltages.chunks_exact_mut(m).zip(voltages) {
            joints.fill(volts / m as f64);
        }
        for (volts, gain) in state.motor_voltages.iter_mut().zip(&self.gains) {
            *volts *= gain;
        }
        for (k, rung) in self.rungs.iter_mut().enumerate().skip(1) {
            let (left, right) = joints_of(k, self.root);
            let volts = |joint: Option<usize>| joint.and_then(|i| state.motor_voltages.get(i)).copied().unwrap_or(0.0);
            // Seen from the root, joint angles are themselves on the left arm and their negatives on the right.
            rung.volts = f64x2::new([volts(left), -volts(Some(right))]);
            rung.rest_angle = f64x2::splat(self.joint.rest_angle_per_volt) * rung.volts;
            if !self.rest_angles.is_empty() {
                let rest = |joint: Option<usize>| joint.and_then(|i| self.rest_angles.get(i)).copied().unwrap_or(0.0);
                rung.rest_angle += f64x2::new([rest(left), -rest(Some(right))]);
            }
        }
    }

    /// Reads the joints' angles and rates, and computes their torques.
    fn read_joints(&mut self) {
        let state = &mut self.state;
        let lag = f64x2::splat(self.joint.damping_time);
        let first = &self.rungs[0];
        let mut inner = [first.angle, first.motion[0]].map(|value| f64x2::splat(value.to_array()[0]));
        for (k, rung) in self.rungs.iter().enumerate().skip(1) {
            let (left, right) = joints_of(k, self.root);
            let (angle, rate) = (rung.angle - inner[0], rung.motion[0] - inner[1]);
            inner = [rung.angle, rung.motion[0]];
            let mut torque = rung.stiffness * (angle - rung.rest_angle + lag * rate);
            if let Some(beyond) = &self.beyond {
                torque -= beyond.now(k, rung, angle - rung.rest_angle, rate);
            }
            let [angle, rate, torque] = [angle, rate, torque].map(f64x2::to_array);
            if let Some(i) = left {
                (state.angles[i], state.rates[i], state.torques[i]) = (angle[0], rate[0], -torque[0]);
            }
            if right < state.angles.len() {
                (state.angles[right], state.rates[right], state.torques[right]) = (-angle[1], -rate[1], torque[1]);
            }
        }
    }

    /// Fails if a coordinate is no number.
    fn check_finite(&mut self) -> Result<(), EngineError> {
        self.read_joints();
        let bad = self.state.angles.iter().zip(&self.state.rates).position(|(a, r)| !(a + r).is_finite());
        if bad.is_none() && self.centre.iter().chain(&self.velocity).all(|value| value.is_finite()) {
            self.finite = true;
            return Ok(());
        }
        let what =
            bad.map_or_else(|| "the centre of mass".to_owned(), |joint| format!("the angle or rate of joint {}", joint + 1));
        let time = self.step as f64 * self.time_step;
        Err(EngineError::NotFinite { what, value: f64::NAN, step: self.step, time, stable_step: self.stable_step })
    }
}

/// What the next rung finds of `value` at its inner ends: both bodies of the rung after the root hang on the root.
#[inline(always)]
fn outwards(value: f64x2, rung: usize) -> f64x2 {
    if rung == 0 { f64x2::splat(value.to_array()[0]) } else { value }
}

/// Sets the levers: each body by its own share of the mass up to its middle, and by all that hangs on its other end with its whole length.
fn hang_levers(rungs: &mut [Rung]) {
    let mut outside = f64x2::ZERO;
    for (k, rung) in rungs.iter_mut().enumerate().rev() {
        if k == 0 {
            // On the root's other end hangs the right arm.
            outside = f64x2::splat(outside.to_array()[1]);
        }
        rung.lever = rung.reach * (rung.share * rung.middle + outside);
        outside += rung.share;
    }
}

/// Gravity along x and z (cm/s²) of a floor that rises by `slope` (rad) along +x, in its axes.
fn pull(gravity: f64, slope: f64) -> [f64; 2] {
    if slope == 0.0 { [0.0, -gravity] } else { [-gravity * slope.sin(), -gravity * slope.cos()] }
}

/// Rung and lane of body `i` of a chain with this root.
fn place(i: usize, root: usize) -> (usize, usize) {
    if i <= root { (root - i, 0) } else { (i - root, 1) }
}

/// The joints at the reference points of rung `k` of a chain with this root. That of the left arm's body is on its right, that of the right
/// arm's, which may have ended, on its left.
fn joints_of(k: usize, root: usize) -> (Option<usize>, usize) {
    (root.checked_sub(k), root + k - 1)
}

fn put(lanes: &mut f64x2, lane: usize, value: f64) {
    lanes.as_mut_array()[lane] = value;
}

impl Engine for PlanarEngine {
    fn prepare(&mut self, voltages: &[f64]) -> Result<(), EngineError> {
        self.apply(voltages);
        if self.finite { Ok(()) } else { self.check_finite() }
    }

    fn joints(&mut self) -> &JointState {
        self.read_joints();
        &self.state
    }

    /// Positions and velocities of the same time, unlike the reference's.
    fn nodes(&mut self, positions: &mut [f64], velocities: &mut [f64]) -> Result<(), EngineError> {
        self.posed(|engine| {
            let (mut position, mut velocity) = engine.left_end();
            let rows = positions.chunks_exact_mut(3).zip(velocities.chunks_exact_mut(3));
            for (i, (node, node_velocity)) in rows.enumerate() {
                node.copy_from_slice(&[position[0], 0.0, position[1]]);
                node_velocity.copy_from_slice(&[velocity[0], 0.0, velocity[1]]);
                if i < engine.count {
                    let [x, z] = engine.body_vector(i);
                    let rate = engine.of_body(i, |rung| rung.motion[0]);
                    position = [position[0] + x, position[1] + z];
                    velocity = [velocity[0] - rate * z, velocity[1] + rate * x];
                }
            }
        });
        Ok(())
    }

    fn base(&mut self) -> Result<PlanarBase, EngineError> {
        Ok(self.posed(|engine| {
            let (position, velocity) = engine.left_end();
            let [x, z] = engine.body_vector(0).map(|part| 0.5 * part);
            let rate = engine.of_body(0, |rung| rung.motion[0]);
            PlanarBase {
                position: [position[0] + x, position[1] + z],
                pitch: -engine.of_body(0, |rung| rung.angle),
                velocity: [velocity[0] - rate * z, velocity[1] + rate * x],
                pitch_rate: -rate,
            }
        }))
    }

    fn contacts(&mut self, contacts: &mut Vec<Contact>) -> Result<(), EngineError> {
        contacts.clear();
        self.posed(|engine| {
            let Some(floor) = &engine.floor else { return };
            let (mut left, _) = engine.left_end();
            for i in 0..engine.count {
                let vector = engine.body_vector(i);
                let right = [left[0] + vector[0], left[1] + vector[1]];
                let (rung, lane) = place(i, engine.root);
                let reference = if i < engine.root { right } else { left };
                for [arm, impulse] in floor.of_body(rung, lane, &engine.law) {
                    if impulse[1] > 0.0 {
                        let position = [0, 1].map(|k| reference[k] + arm[k]);
                        contacts.push(Contact { link: i, position, force: impulse.map(|part| part / engine.time_step) });
                    }
                }
                left = right;
            }
        });
        Ok(())
    }

    fn advance(&mut self) -> Result<(), EngineError> {
        let h = self.time_step;
        let share = self.weight * h;
        self.begin_step(share);
        if let Some(floor) = self.floor.as_ref().filter(|floor| floor.is_viscous()) {
            let (height, _) = self.root_over_floor();
            floor.push_viscous(&mut self.rungs, height, share);
        }
        self.solve_step(share)?;
        let (step, per_weight) = (f64x2::splat(h), f64x2::splat(1.0 / self.weight));
        let (mut momentum, mut changed) = ([f64x2::ZERO; 2], f64x2::ZERO);
        let (mut inner, mut turns) = ([f64x2::ZERO; 2], [f64x2::ZERO; 2]);
        for (k, rung) in self.rungs.iter_mut().enumerate() {
            let mean = rung.mean_of_centre();
            let before = rung.angle;
            rung.angle += step * mean[0];
            // The root has no joint, and no voltage.
            let turn = if k == 0 { f64x2::ZERO } else { (rung.angle - inner[1]) - (before - inner[0]) };
            inner = [outwards(before, k), outwards(rung.angle, k)];
            turns = [turns[0] + rung.volts * turn, turns[1] + turn * turn];
            let change: Spatials = std::array::from_fn(|k| (mean[k] - rung.motion[k]) * per_weight);
            for (motion, change) in rung.motion.iter_mut().zip(change) {
                *motion += change;
            }
            changed += rung.inertia * change[0] * change[0] + rung.mass * (change[1] * change[1] + change[2] * change[2]);
            momentum[0] += rung.share * rung.motion[1];
            momentum[1] += rung.share * rung.motion[2];
        }
        let changed = changed.reduce_add();
        self.finite = changed.is_finite();
        self.numerical_loss += (self.weight - 0.5) * changed;
        if !self.clamped() {
            for (k, share) in momentum.into_iter().enumerate() {
                let after = share.reduce_add();
                self.centre[k] += h * (self.velocity[k] + self.weight * (after - self.velocity[k]));
                self.velocity[k] = after;
            }
        }
        self.turns = [0, 1].map(|k| self.turns[k] + turns[k].reduce_add());
        self.step += 1;
        Ok(())
    }

    fn turns(&self) -> [f64; 2] {
        self.turns
    }

    fn midpoint(&self) -> bool {
        true
    }

    fn kinetic_energy(&self) -> Option<f64> {
        let twice = |rung: &Rung| {
            let [rate, x, z] = rung.motion;
            rung.mass * (x * x + z * z) + rung.inertia * rate * rate
        };
        Some(0.5 * self.rungs.iter().map(twice).fold(f64x2::ZERO, |a, b| a + b).reduce_add())
    }

    fn gravitational_energy(&self) -> Option<f64> {
        (!self.clamped()).then(|| self.mass * self.gravity * self.centre[1])
    }

    fn numerical_loss(&self) -> f64 {
        self.numerical_loss
    }

    /// Angles of the bodies (rad, anticlockwise), then rate (rad/s) and velocity of the centre of mass (cm/s) of each, then centre of mass and
    /// velocity of the robot, then the directions of the last step's middle with their angles, then the corners' states.
    fn save(&self) -> Result<Vec<f64>, EngineError> {
        let bodies = || 0..self.count;
        let mut state: Vec<f64> = bodies().map(|i| self.of_body(i, |rung| rung.angle)).collect();
        state.extend(bodies().flat_map(|i| [0, 1, 2].map(|k| self.of_body(i, |rung| rung.motion[k]))));
        state.extend(self.centre);
        state.extend(self.velocity);
        state.extend(bodies().flat_map(|i| [0, 1].map(|k| self.of_body(i, |rung| rung.along[k]))));
        state.extend(bodies().map(|i| self.of_body(i, |rung| rung.posed)));
        state.extend(self.floor.iter().flat_map(|floor| floor.saved()));
        state.extend(self.beyond.iter().flat_map(Beyond::saved));
        Ok(state)
    }

    fn load(&mut self, step: u64, state: &[f64]) -> Result<(), EngineError> {
        let count = self.count;
        let corners = self.floor.iter().flat_map(|floor| floor.saved()).count();
        let memory = self.beyond.iter().flat_map(Beyond::saved).count();
        if state.len() != 7 * count + 4 + corners + memory || state.iter().any(|value| !value.is_finite()) {
            return Err(EngineError::State);
        }
        let (angles, rest) = state.split_at(count);
        let (motions, rest) = rest.split_at(3 * count);
        let (centre, rest) = rest.split_at(4);
        let (along, rest) = rest.split_at(2 * count);
        let (posed, rest) = rest.split_at(count);
        let (corners, memory) = rest.split_at(corners);
        for i in 0..count {
            let (rung, lane) = place(i, self.root);
            let at = &mut self.rungs[rung];
            put(&mut at.angle, lane, angles[i]);
            put(&mut at.posed, lane, posed[i]);
            (0..3).for_each(|k| put(&mut at.motion[k], lane, motions[3 * i + k]));
            (0..2).for_each(|k| put(&mut at.along[k], lane, along[2 * i + k]));
        }
        (self.centre, self.velocity) = ([centre[0], centre[1]], [centre[2], centre[3]]);
        if let Some(floor) = &mut self.floor {
            floor.restore(corners);
        }
        if let Some(beyond) = &mut self.beyond {
            beyond.restore(memory);
        }
        self.finite = false;
        self.step = step;
        Ok(())
    }

    fn step(&self) -> u64 {
        self.step
    }

    fn clamp_hits(&self) -> Option<ClampHits> {
        None
    }
}
