//! The same robot in the plane: springs and dampers implicit, contact by time stepping, every step linear in the number of links.
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
//! 0 ≤ v_n⁺ + gap/h + c λ_n/h  ⊥  λ_n ≥ 0,        |λ_t| ≤ μ λ_n
//! ```
//!
//! with v⁺ in the pose of the end: that of the middle gives J V⁺, and the way of a corner turns by h/2 of its acceleration at constant rates until then.
//! Without it a corner that stands still on a turning body would creep by h/2 of that, and results would be of first order. c is so small that it only says
//! how a weight is shared among many corners, the same at all steps ([`contact`]).
//!
//! so a corner never passes the floor: it stops on it, without bounce. These are the time steps of Stewart and Trinkle and of Moreau and Jean,
//! with the midpoint rule between them. Steps are cut where corners land ([`landing`]). Newton's method over the corners' contact modes (open, sticking,
//! sliding either way), from those of the step before, puts active corners into the recursion as terms of their bodies' inertia. Where it goes round in
//! circles a path is followed that changes one corner at a time ([`path`]), in the end Lemke's from open corners. A step that is not solved to rounding is
//! an error. Where Coulomb's law has several solutions (Painlevé), it is the first of these methods that chooses.
//!
//! [`FrictionModel::Convex`] is the convex model of Anitescu instead: its minimum is unique, and sliding lifts a corner by μ·h·|v_t|, which
//! vanishes with the step. In long chains the parts where corners change are solved by themselves in between.
//!
//! # References
//!
//! R. Featherstone, *Rigid Body Dynamics Algorithms*, chapter 7 (articulated bodies). D. E. Stewart and J. C. Trinkle, Int. J. Numer. Meth.
//! Eng. 39 (1996) (time stepping with complementarity). M. Anitescu, Math. Program. 105 (2006) (the convex model). A. Castro et al., arXiv
//! 2110.10107 (regularised cones and Newton's method).

mod contact;
mod floor;
mod joint_extensions;
mod landing;
mod lanes;
mod newton;
mod path;
mod places;
mod recursion;
mod statics;

use fearless_simd::{Level, Simd, dispatch, prelude::*};
use wide::f64x2;

use self::contact::{Ahead, Law};
use self::floor::{Floor, Surface};
pub(super) use self::joint_extensions::GAUSS;
use self::joint_extensions::{JointExtensions, LARGEST_REPETITIONS};
use self::lanes::{Four, Lanes, Two, fma, inner, on};
use self::newton::{LARGEST_STEPS, LONGEST_WHOLE, MORE_PER_BODY};
use self::recursion::{BLOCK, BaseJoint, Motions, Outside, Quad, direction};
use super::{ClampHits, Contact, Engine, EngineError, JointState, PlanarBase};
use crate::actuator::PiezoJoint;
use crate::analytic;
use crate::model::{Mount, Robot};

/// Bullet's limit on the product of two friction coefficients, kept for equal friction.
pub(super) const LARGEST_FRICTION: f64 = 10.0;
/// The weight of a step's end over that of its start is 1/2 + this (1/s) times the step, so that what alternates from step to step dies out:
/// a velocity that springs and dampers dictate keeps −(1 − w)/w of an alternation per step. For a mode of angular frequency ω this adds
/// h (w − 1/2) ω/2 to the damping ratio, of second order in h.
pub(crate) const NUMERICAL_DAMPING: f64 = 50.0;
/// The links' directions are computed anew every so many steps, for turning them on loses a last digit at times.
const EXACT_EVERY: u64 = 256;

/// Largest angles (rad), rates, places and velocities (CGS): their squares are numbers too.
const LARGEST_COORDINATE: f64 = 1e100;

/// The law of friction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FrictionModel {
    /// Coulomb's law, solved to rounding in every step.
    #[default]
    Coulomb,
    /// Anitescu's convex relaxation. Sliding lifts a corner by μ·h·|v_t|, so that results over films of friction 2 to 4 are 10 % and more off
    /// at steps of 10⁻⁴ s, and may need 10⁻⁶ s.
    Convex,
}

/// The robot as a planar chain.
pub struct PlanarEngine {
    joint: PiezoJoint,
    motors_per_actuator: usize,
    mount: Mount,
    hold: BaseJoint,
    /// Rest angle of each joint at 0 V (rad) and factor on its voltage, where there are such.
    rest_angles: Vec<f64>,
    gains: Vec<f64>,
    beyond: Option<JointExtensions>,
    time_step: f64,
    gravity: f64,
    /// Along x and z (cm/s²).
    pull: [f64; 2],
    mass: f64,
    /// Number of bodies, and which one is the root.
    count: usize,
    root: usize,
    lengths: Vec<f64>,
    quads: Vec<Quad>,
    /// Levels with a body; if odd, the last quad has one without.
    levels: usize,
    /// Directions put aside while others are looked at, or the links' vectors for the nodes' places.
    kept: Vec<[Lanes; 2]>,
    /// Centre of mass (cm) and its velocity (cm/s). A clamped chain has its left end here.
    centre: [f64; 2],
    velocity: [f64; 2],
    /// Without corners but for robots on the ground.
    floor: Floor,
    /// Mean motions of the reference points in the iterate of the contact problem.
    iterate: Vec<[Lanes; 3]>,
    /// Newton steps after which a contact problem is given up.
    largest_steps: u32,
    /// Of each block of levels, in chains on the ground that are long enough for solving in parts; empty otherwise.
    outside: Vec<Outside>,
    /// Blocks with corners of which a solution asks other states.
    asking: Vec<bool>,
    law: Law,
    weight: f64,
    /// The weight is ½ + this (1/s) times the step.
    numerical_damping: f64,
    /// Of the machine's registers.
    level: Level,
    step: u64,
    /// What was last asked for of the joints, but for the voltages, which are always those of [`prepare`](Engine::prepare).
    state: JointState,
    /// The actuators' voltages of the last [`prepare`](Engine::prepare) (V).
    voltages: Vec<f64>,
    /// Whether the state is known to be numbers, because the changes of the last step were.
    finite: bool,
    /// Of all steps, for the energy audit.
    work_sums: [f64; 2],
    /// Newton iterations so far, of all steps.
    iterations: u64,
    /// Paths that were followed.
    paths: u64,
    path: Vec<path::Pair>,
    /// Energy that the weight of the step's end has taken so far (erg).
    numerical_loss: f64,
}

impl PlanarEngine {
    /// Builds `robot`, at rest and flat, to be stepped by `time_step` (s).
    ///
    /// # Errors
    /// [`EngineError::Model`] for a robot that cannot be built, [`EngineError::TimeStep`], [`EngineError::StepTooLong`].
    pub fn new(robot: &Robot, time_step: f64) -> Result<Self, EngineError> {
        Self::with_numerical_damping(robot, time_step, NUMERICAL_DAMPING)
    }

    /// The same with another weight of the step's end: ½ + `damping` (1/s) times the step. Less is more exact for a robot that touches nothing.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_numerical_damping(robot: &Robot, time_step: f64, damping: f64) -> Result<Self, EngineError> {
        robot.check()?;
        EngineError::unless_step(time_step)?;
        let longest = 0.1 / (analytic::cantilever_frequency(robot) * (robot.actuators as f64).powi(2));
        if time_step > longest {
            return Err(EngineError::StepTooLong { time_step, longest });
        }
        let segments = robot.segments();
        let count = segments.len();
        let joint = robot.joint();
        let thickness = robot.collision_thickness;
        let extensions = &robot.extensions;
        let bodies = robot.rigid_bodies();
        let mass: f64 = bodies.iter().map(|body| body.mass).sum();
        let weight = weight_of(damping, time_step);
        let clamped = robot.mount == Mount::Clamped;
        let root = if clamped { 0 } else { count / 2 };
        let levels = root.max(count - 1 - root) + 1;
        let blocks = if robot.mount == Mount::Ground && levels > LONGEST_WHOLE { levels.div_ceil(BLOCK) } else { 0 };
        let mut quads = vec![Quad::empty(); levels.div_ceil(2)];
        let mut frictions = vec![[0.0; 2]; levels];
        for (i, segment) in segments.iter().enumerate() {
            let (quad, lane) = place(i, root);
            let at = &mut quads[quad];
            at.mass.set_lane(lane, bodies[i].mass);
            at.share.set_lane(lane, bodies[i].mass / mass);
            at.inertia.set_lane(lane, bodies[i].inertia);
            at.middle.set_lane(lane, if i < root { 1.0 - bodies[i].middle } else { bodies[i].middle });
            at.reach.set_lane(lane, if i < root { -segment.length } else { segment.length });
            at.stiffness.set_lane(lane, joint.stiffness);
            frictions[2 * quad + lane / 2][lane % 2] = (segment.friction * robot.friction.ground).min(LARGEST_FRICTION);
        }
        for quad in &mut quads {
            let half = quad.middle * quad.reach;
            quad.inertia_at_reference = quad.inertia + quad.mass * half * half;
        }
        hang_levers(&mut quads);
        // The base's centre stands at the origin, as in Bullet.
        let left = -0.5 * segments[0].length;
        let (mut at, mut moment) = (left, 0.0);
        for (segment, body) in segments.iter().zip(&bodies) {
            moment += body.mass * (at + body.middle * segment.length);
            at += segment.length;
        }
        let hold = match robot.mount {
            Mount::Clamped if extensions.clamp_compliance > 0.0 => BaseJoint::Hinged,
            Mount::Clamped => BaseJoint::Clamped,
            _ => BaseJoint::Free,
        };
        if hold == BaseJoint::Hinged {
            quads[0].stiffness.set_lane(0, 1.0 / extensions.clamp_compliance);
        }
        set_implicit(&mut quads, &joint, hold, weight, time_step);
        let m = robot.motors_per_actuator;
        let rest_angles =
            extensions.rest_curvature.iter().flat_map(|curvature| vec![curvature * robot.link_length(); m]).collect();
        let joints = || vec![0.0; count - 1];
        let mut engine = Self {
            joint,
            motors_per_actuator: robot.motors_per_actuator,
            mount: robot.mount,
            hold,
            rest_angles,
            gains: extensions.joint_gains.clone(),
            beyond: JointExtensions::new(extensions, robot.material.width, robot.link_length(), time_step, &quads),
            time_step,
            gravity: robot.material.gravity,
            pull: pull(robot.material.gravity, extensions.slope),
            mass,
            count,
            root,
            lengths: segments.iter().map(|segment| segment.length).collect(),
            kept: vec![[Lanes::ZERO; 2]; quads.len()],
            centre: if clamped { [left, 0.0] } else { [moment / mass, 0.0] },
            velocity: [0.0; 2],
            floor: if robot.mount == Mount::Ground {
                Floor::new(&frictions, 0.5 * thickness, Surface::new(extensions))
            } else {
                Floor::new(&[], 0.0, None)
            },
            iterate: vec![[Lanes::ZERO; 3]; quads.len()],
            largest_steps: LARGEST_STEPS + MORE_PER_BODY * count as u32,
            outside: vec![Outside::default(); blocks],
            asking: vec![false; blocks],
            quads,
            levels,
            law: Law::new(time_step, weight, mass / count as f64, FrictionModel::default()),
            weight,
            numerical_damping: damping,
            level: Level::new(),
            step: 0,
            state: JointState { angles: joints(), rates: joints(), torques: joints(), motor_voltages: joints() },
            voltages: Vec::with_capacity(robot.actuators),
            finite: false,
            work_sums: [0.0; 2],
            iterations: 0,
            paths: 0,
            path: Vec::new(),
            numerical_loss: 0.0,
        };
        engine.set_time_step(time_step, None)?;
        Ok(engine)
    }

    /// Contact problems' Newton iterations over all steps so far; 0 for steps without contact.
    pub fn iterations(&self) -> u64 {
        self.iterations
    }

    /// Paths that were followed so far where Newton's method went in circles: seldom more than one in a step.
    pub fn paths(&self) -> u64 {
        self.paths
    }

    /// Chooses the law of friction.
    pub fn set_friction_model(&mut self, friction: FrictionModel) {
        self.law.friction = friction;
        self.law.landing_speed = self.landing_speed();
    }

    /// Lets the floor rise by `angle` (rad) along +x: in its axes gravity is g (−sin, −cos). The books of energy know level floors only.
    pub fn set_slope(&mut self, angle: f64) {
        self.pull = pull(self.gravity, angle);
    }

    fn clamped(&self) -> bool {
        self.mount == Mount::Clamped
    }

    /// One number of body `i`.
    fn of_body(&self, i: usize, what: impl Fn(&Quad) -> Lanes) -> f64 {
        let (quad, lane) = place(i, self.root);
        what(&self.quads[quad]).lane(lane)
    }

    /// Turns the links to where they are in the middle of the step if all goes on at its rates, and loads there what is known of the step's
    /// right side: momenta, gravity, drag and the joints' torques. Finds the corners that may touch.
    #[inline(always)]
    fn begin_step<S: Simd>(&mut self, simd: S) {
        let share = self.weight * self.time_step;
        let ahead = Four::splat(simd, 0.5 * self.time_step);
        let exact = self.step.is_multiple_of(EXACT_EVERY);
        let [pull_x, pull_z] = self.pull.map(|part| share * part);
        let drag = self.beyond.as_ref().filter(|beyond| beyond.has_drag());
        let mut before = Two::splat(simd, 0.0);
        for quad in &mut self.quads {
            let (angle, mass) = (quad.angle.on(simd), quad.mass.on(simd));
            let [rate, x, z] = on(simd, &quad.motion);
            quad.turn_to(fma(ahead, rate, angle), exact);
            let (inner, last) = inner(angle, before);
            quad.load_torque(-share, inner);
            before = last;
            let mut momentum = [quad.inertia.on(simd) * rate, mass * (x + pull_x), mass * (z + pull_z)];
            if let Some(beyond) = drag {
                let drag = beyond.drag(quad);
                (0..3).for_each(|k| momentum[k] += drag[k].on(simd) * share);
            }
            quad.load(momentum);
        }
        if self.floor.is_viscous() {
            let (height, _) = self.root_over_floor(simd);
            self.floor.push_viscous(&mut self.quads, height, share);
        }
        let law = self.law;
        self.find_corners(simd, &law);
    }

    /// Shows `look` the links as they stand now.
    fn posed<T>(&mut self, look: impl FnOnce(&Self) -> T) -> T {
        for (quad, kept) in self.quads.iter_mut().zip(&mut self.kept) {
            *kept = quad.along;
            quad.along = direction(quad.angle);
            dispatch!(self.level, simd => quad.lay(simd));
        }
        let seen = look(self);
        for (quad, kept) in self.quads.iter_mut().zip(&self.kept) {
            quad.along = *kept;
            dispatch!(self.level, simd => quad.lay(simd));
        }
        seen
    }

    /// Where the root's reference point is (cm), as the links are turned, its velocity (cm/s), from the rates and the velocity of the centre of mass,
    /// and its acceleration (cm/s²) if these stay.
    #[inline(always)]
    fn root_motion<S: Simd>(&self, simd: S) -> [[f64; 2]; 3] {
        if self.clamped() {
            return [self.centre, [0.0; 2], [0.0; 2]];
        }
        let zero = Four::splat(simd, 0.0);
        let (mut position, mut velocity, mut acceleration) = ([zero; 2], [zero; 2], [zero; 2]);
        for quad in &self.quads {
            let (lever, rate) = (quad.lever.on(simd), quad.motion[0].on(simd));
            let [x, z] = on(simd, &quad.along).map(|along| lever * along);
            position = [position[0] + x, position[1] + z];
            let turned = [rate * z, rate * x];
            velocity = [velocity[0] - turned[0], velocity[1] + turned[1]];
            acceleration = [fma(rate, turned[1], acceleration[0]), fma(rate, turned[0], acceleration[1])];
        }
        let less = |of: [Four<S>; 2], from: [f64; 2]| [0, 1].map(|k| from[k] - Lanes::from(of[k]).sum());
        [less(position, self.centre), less(velocity, self.velocity), acceleration.map(|part| Lanes::from(part).sum())]
    }

    /// Height of a free robot's root (cm) in the middle of the step, as the links are turned, and its velocity and acceleration at the start.
    #[inline(always)]
    fn root_over_floor<S: Simd>(&self, simd: S) -> (f64, [[f64; 2]; 2]) {
        let [[_, height], velocity, acceleration] = self.root_motion(simd);
        (height + 0.5 * self.time_step * self.velocity[1], [velocity, acceleration])
    }

    /// Position and velocity of the left end of the chain, as the links are turned, with the state's velocities.
    fn left_end(&self) -> ([f64; 2], [f64; 2]) {
        let [mut position, mut velocity, _] = dispatch!(self.level, simd => self.root_motion(simd));
        // The left arm's other ends are left ends.
        for i in (0..self.root).rev() {
            let [x, z] = [0, 1].map(|k| self.of_body(i, |quad| quad.across[k]));
            let rate = self.of_body(i, |quad| quad.motion[0]);
            position = [position[0] + x, position[1] + z];
            velocity = [velocity[0] - rate * z, velocity[1] + rate * x];
        }
        (position, velocity)
    }

    /// Body `i` from its left end to its right one (cm).
    fn body_vector(&self, i: usize) -> [f64; 2] {
        [0, 1].map(|k| self.lengths[i] * self.of_body(i, |quad| quad.along[k]))
    }

    /// Solves the step's mean motion, again and again where joints rub.
    #[inline(always)]
    fn solve_step<S: Simd>(&mut self, simd: S, share: f64) -> Result<(), EngineError> {
        let law = self.law;
        let Some(mut beyond) = self.beyond.take() else { return self.solve_on_floor(simd, &law) };
        beyond.begin(&self.quads);
        let mut result = Ok(());
        for repetition in 1..=LARGEST_REPETITIONS {
            beyond.load(&mut self.quads, share);
            result = self.solve_on_floor(simd, &law);
            if result.is_err() || beyond.accept(&self.quads) || !beyond.is_repeated() {
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
        for k in 1..self.levels {
            let (quad, level) = (&mut self.quads[k / 2], k % 2);
            let (left, right) = joints_of(k, self.root);
            let volts = |joint: Option<usize>| joint.and_then(|i| state.motor_voltages.get(i)).copied().unwrap_or(0.0);
            // Seen from the root, joint angles are themselves on the left arm and their negatives on the right.
            let volts = f64x2::new([volts(left), -volts(Some(right))]);
            let mut rest_angle = f64x2::splat(self.joint.rest_angle_per_volt) * volts;
            if !self.rest_angles.is_empty() {
                let rest = |joint: Option<usize>| joint.and_then(|i| self.rest_angles.get(i)).copied().unwrap_or(0.0);
                rest_angle += f64x2::new([rest(left), -rest(Some(right))]);
            }
            quad.volts.set_level(level, volts);
            quad.rest_angle.set_level(level, rest_angle);
        }
    }

    /// Reads the joints' angles and rates, and computes their torques.
    fn read_joints(&mut self) {
        let state = &mut self.state;
        let lag = Lanes::splat(self.joint.damping_time);
        let mut before = [f64x2::ZERO; 2];
        for (k, quad) in self.quads.iter().enumerate() {
            let angle = quad.angle - quad.angle.inner(before[0]);
            let rate = quad.motion[0] - quad.motion[0].inner(before[1]);
            before = [quad.angle.level(1), quad.motion[0].level(1)];
            let mut torque = quad.stiffness * (angle - quad.rest_angle + lag * rate);
            if let Some(beyond) = &self.beyond {
                torque += -beyond.now(k, quad, angle - quad.rest_angle, rate);
            }
            // The root, in the first two lanes, has no joint.
            for lane in if k == 0 { 2..4 } else { 0..4 } {
                let (left, right) = joints_of(2 * k + lane / 2, self.root);
                let (joint, sign) = if lane % 2 == 0 { (left, 1.0) } else { (Some(right), -1.0) };
                if let Some(i) = joint.filter(|i| *i < state.angles.len()) {
                    let [angle, rate, torque] = [angle, rate, torque].map(|of| sign * of.lane(lane));
                    (state.angles[i], state.rates[i], state.torques[i]) = (angle, rate, -torque);
                }
            }
        }
    }

    /// A step, in registers of this machine.
    #[inline(always)]
    fn advance_here<S: Simd>(&mut self, simd: S) -> Result<(), EngineError> {
        self.begin_step(simd);
        self.floor.begin_whole();
        if self.floor.first_landing() < self.time_step {
            self.advance_in_parts(simd)?;
        } else {
            self.end_step(simd)?;
        }
        self.step += 1;
        Ok(())
    }

    /// Solves the step that was begun and takes it.
    #[inline(always)]
    fn end_step<S: Simd>(&mut self, simd: S) -> Result<(), EngineError> {
        let h = self.time_step;
        self.solve_step(simd, self.weight * h)?;
        let [step, per_weight, zero] = [h, 1.0 / self.weight, 0.0].map(|value| Four::splat(simd, value));
        let (mut momentum, mut changed) = ([zero; 2], zero);
        let (mut before, mut turns) = (None, [zero; 2]);
        for quad in &mut self.quads {
            let mean = quad.mean_of_centre(simd);
            let start = quad.angle.on(simd);
            let end = fma(step, mean[0], start);
            quad.angle = end.into();
            // The root has no joint.
            let (inner_start, inner_end) = before.unwrap_or((start.split().0, end.split().0));
            let ((inner_start, last_start), (inner_end, last_end)) = (inner(start, inner_start), inner(end, inner_end));
            let turn = (end - inner_end) - (start - inner_start);
            before = Some((last_start, last_end));
            turns = [fma(quad.volts.on(simd), turn, turns[0]), fma(turn, turn, turns[1])];
            let motion = on(simd, &quad.motion);
            let change: Motions<S> = std::array::from_fn(|k| mean[k] - motion[k]);
            let after: Motions<S> = std::array::from_fn(|k| fma(change[k], per_weight, motion[k]));
            (0..3).for_each(|k| quad.motion[k] = after[k].into());
            let [turn, x, z] = change;
            let (mass, share) = (quad.mass.on(simd), quad.share.on(simd));
            changed = fma(quad.inertia.on(simd) * turn, turn, fma(mass, fma(x, x, z * z), changed));
            momentum = [fma(share, after[1], momentum[0]), fma(share, after[2], momentum[1])];
        }
        let changed = Lanes::from(changed).sum();
        self.finite = changed < LARGEST_COORDINATE;
        self.numerical_loss += (self.weight - 0.5) / (self.weight * self.weight) * changed;
        if !self.clamped() {
            for (k, share) in momentum.into_iter().enumerate() {
                let after = Lanes::from(share).sum();
                self.centre[k] += h * (self.velocity[k] + self.weight * (after - self.velocity[k]));
                self.velocity[k] = after;
            }
        }
        let [volts, squares] = turns.map(|turns| Lanes::from(turns).sum());
        self.work_sums = [self.work_sums[0] + volts, self.work_sums[1] + squares * self.law.per_step()];
        Ok(())
    }

    /// Turns bodies without mass as their inner neighbours are turned: steps keep them so.
    fn follow(&mut self) {
        for (k, lane) in (0..self.quads.len()).flat_map(|k| (0..4).map(move |lane| (k, lane))) {
            if self.quads[k].mass.lane(lane) > 0.0 {
                continue;
            }
            let from = match (k, lane) {
                (0, 1) => (0, 0),
                (k, 0 | 1) => (k - 1, lane + 2),
                (k, lane) => (k, lane - 2),
            };
            let Quad { angle, posed, motion: [rate, ..], along: [x, z], .. } = self.quads[from.0];
            let at = &mut self.quads[k];
            let [to_x, to_z] = &mut at.along;
            for (to, number) in [(&mut at.angle, angle), (&mut at.posed, posed), (&mut at.motion[0], rate), (to_x, x), (to_z, z)]
            {
                to.set_lane(lane, number.lane(from.1));
            }
        }
    }

    /// Fails if a coordinate is no number, or so large that no recording takes it.
    fn check_finite(&mut self) -> Result<(), EngineError> {
        self.read_joints();
        let sound = |value: f64| value.abs() <= LARGEST_COORDINATE;
        let bad = self.state.angles.iter().zip(&self.state.rates).position(|(a, r)| !sound(*a) || !sound(*r));
        if bad.is_none() && self.centre.iter().chain(&self.velocity).all(|value| sound(*value)) {
            self.finite = true;
            return Ok(());
        }
        let of_joint = |joint: usize| [self.state.angles[joint], self.state.rates[joint]];
        let (what, values) = match bad {
            Some(joint) => (format!("the angle or rate of joint {}", joint + 1), of_joint(joint).to_vec()),
            None => ("the centre of mass".to_owned(), [self.centre, self.velocity].concat()),
        };
        let value = values.into_iter().find(|value| !sound(*value)).unwrap_or(f64::NAN);
        let time = self.step as f64 * self.time_step;
        Err(EngineError::NotFinite { what, value, step: self.step, time, stable_step: None })
    }
}

/// Weight of a step's end, of a step of `time_step` (s) with numerical damping (1/s).
fn weight_of(damping: f64, time_step: f64) -> f64 {
    (0.5 + damping * time_step).min(1.0)
}

/// Sets what springs and dampers add to the joints' inertia in a step of `time_step` (s).
fn set_implicit(quads: &mut [Quad], joint: &PiezoJoint, hold: BaseJoint, weight: f64, time_step: f64) {
    let implicit = Lanes::splat(weight * time_step * joint.stiffness * (joint.damping_time + 0.5 * time_step));
    for quad in quads.iter_mut() {
        quad.implicit = implicit.where_positive(quad.mass, Lanes::splat(1.0));
    }
    if hold == BaseJoint::Hinged {
        let stiffness = quads[0].stiffness.lane(0);
        quads[0].implicit.set_lane(0, weight * time_step * stiffness * 0.5 * time_step);
    }
}

/// Sets the levers: each body by its own share of the mass up to its middle, and by all that hangs on its other end with its whole length.
fn hang_levers(quads: &mut [Quad]) {
    let mut outside = f64x2::ZERO;
    for k in (0..2 * quads.len()).rev() {
        let (quad, level) = (&mut quads[k / 2], k % 2);
        if k == 0 {
            // On the root's other end hangs the right arm.
            outside = f64x2::splat(outside.to_array()[1]);
        }
        let share = quad.share.level(level);
        quad.lever.set_level(level, quad.reach.level(level) * (share * quad.middle.level(level) + outside));
        outside += share;
    }
}

/// Gravity along x and z (cm/s²) of a floor that rises by `slope` (rad) along +x, in its axes.
fn pull(gravity: f64, slope: f64) -> [f64; 2] {
    if slope == 0.0 { [0.0, -gravity] } else { [-gravity * slope.sin(), -gravity * slope.cos()] }
}

/// Quad and lane of body `i` of a chain with this root.
fn place(i: usize, root: usize) -> (usize, usize) {
    let (level, arm) = if i <= root { (root - i, 0) } else { (i - root, 1) };
    (level / 2, 2 * (level % 2) + arm)
}

/// The joints at the reference points of level `k` of a chain with this root. That of the left arm's body is on its right, that of the right
/// arm's, which may have ended, on its left.
fn joints_of(k: usize, root: usize) -> (Option<usize>, usize) {
    (root.checked_sub(k), root + k - 1)
}

impl Engine for PlanarEngine {
    fn prepare(&mut self, voltages: &[f64]) -> Result<(), EngineError> {
        // Without the division by the motors of an actuator, in every step.
        if voltages.len() * self.motors_per_actuator + 1 != self.count {
            return Err(EngineError::Voltages { given: voltages.len(), needed: self.actuators() });
        }
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
                    let rate = engine.of_body(i, |quad| quad.motion[0]);
                    position = [position[0] + x, position[1] + z];
                    velocity = [velocity[0] - rate * z, velocity[1] + rate * x];
                }
            }
        });
        Ok(())
    }

    fn places(&mut self, nodes: &mut [[f64; 2]]) -> Result<(), EngineError> {
        dispatch!(self.level, simd => self.places_here(simd, nodes));
        Ok(())
    }

    fn landing(&mut self, least: f64) -> f64 {
        if self.mount == Mount::Ground { dispatch!(self.level, simd => self.landing_here(simd, least)) } else { f64::INFINITY }
    }

    fn motor_voltages(&self) -> &[f64] {
        &self.state.motor_voltages
    }

    fn base(&mut self) -> Result<PlanarBase, EngineError> {
        Ok(self.posed(|engine| {
            let (position, velocity) = engine.left_end();
            let [x, z] = engine.body_vector(0).map(|part| 0.5 * part);
            let rate = engine.of_body(0, |quad| quad.motion[0]);
            PlanarBase {
                position: [position[0] + x, position[1] + z],
                pitch: -engine.of_body(0, |quad| quad.angle),
                velocity: [velocity[0] - rate * z, velocity[1] + rate * x],
                pitch_rate: -rate,
            }
        }))
    }

    fn contacts(&mut self, contacts: &mut Vec<Contact>) -> Result<(), EngineError> {
        contacts.clear();
        self.posed(|engine| {
            if engine.mount != Mount::Ground {
                return;
            }
            let (mut left, _) = engine.left_end();
            for i in 0..engine.count {
                let vector = engine.body_vector(i);
                let right = [left[0] + vector[0], left[1] + vector[1]];
                let (quad, lane) = place(i, engine.root);
                let ends = if i < engine.root { [right, left] } else { [left, right] };
                // The side of the box that looks down.
                let [cos, sin] = vector.map(|part| part / engine.lengths[i]);
                let down = engine.floor.half_thickness().copysign(cos);
                let impulses = engine.floor.impulses_on(2 * quad + lane / 2, lane % 2, &engine.law);
                for (end, impulse) in ends.into_iter().zip(impulses) {
                    if impulse[1] > 0.0 {
                        let position = [end[0] + down * sin, end[1] - down * cos];
                        contacts.push(Contact { link: i, position, force: impulse.map(|part| part / engine.time_step) });
                    }
                }
                left = right;
            }
        });
        Ok(())
    }

    fn advance(&mut self) -> Result<(), EngineError> {
        dispatch!(self.level, simd => self.advance_here(simd))
    }

    fn work_sums(&self) -> [f64; 2] {
        self.work_sums
    }

    fn midpoint(&self) -> bool {
        true
    }

    fn kinetic_energy(&self) -> Option<f64> {
        let twice = |quad: &Quad| {
            let [rate, x, z] = quad.motion;
            quad.mass * (x * x + z * z) + quad.inertia * rate * rate
        };
        Some(0.5 * self.quads.iter().map(twice).fold(Lanes::ZERO, |a, b| a + b).sum())
    }

    fn gravitational_energy(&self) -> Option<f64> {
        (!self.clamped()).then(|| self.mass * self.gravity * self.centre[1])
    }

    fn numerical_loss(&self) -> f64 {
        self.numerical_loss
    }

    fn set_time_step(&mut self, time_step: f64, ahead: Option<f64>) -> Result<(), EngineError> {
        self.set_length(time_step, ahead.map_or_else(|| landing::ahead(time_step), Ahead::all));
        self.law.at_once = time_step;
        self.law.landing_speed = if ahead.is_none() { self.landing_speed() } else { f64::INFINITY };
        Ok(())
    }

    fn set_step(&mut self, step: u64) {
        self.step = step;
    }

    /// All lanes as they are, with the sums of energy.
    fn checkpoint(&self, into: &mut Vec<f64>) -> Result<(), EngineError> {
        for Quad { angle, posed, along: [x, z], motion: [a, b, c], .. } in &self.quads {
            for lanes in [angle, posed, x, z, a, b, c] {
                into.extend_from_slice(&lanes.to_array());
            }
        }
        into.extend(self.centre.iter().chain(&self.velocity).chain(&self.work_sums));
        into.extend([self.numerical_loss, self.step as f64]);
        into.extend(self.floor.saved());
        into.extend(self.beyond.iter().flat_map(JointExtensions::saved));
        Ok(())
    }

    fn rewind(&mut self, checkpoint: &[f64]) -> Result<(), EngineError> {
        let (lanes, rest) = checkpoint.split_at(4 * 7 * self.quads.len());
        let mut lanes = lanes.as_chunks().0.iter().map(|values| Lanes::new(*values));
        for Quad { angle, posed, along: [x, z], motion: [a, b, c], .. } in &mut self.quads {
            for to in [angle, posed, x, z, a, b, c] {
                *to = lanes.next().ok_or(EngineError::State)?;
            }
        }
        let [x, z, vx, vz, volts, squares, loss, step, ref rest @ ..] = *rest else { return Err(EngineError::State) };
        let (corners, memory) = rest.split_at(self.floor.saved().count());
        self.floor.restore(corners);
        self.step = step as u64;
        (self.centre, self.velocity, self.work_sums, self.numerical_loss) = ([x, z], [vx, vz], [volts, squares], loss);
        if let Some(beyond) = &mut self.beyond {
            beyond.restore(memory);
        }
        self.finite = true;
        Ok(())
    }

    /// Angles of the bodies (rad, anticlockwise), then rate (rad/s) and velocity of the centre of mass (cm/s) of each, then centre of mass and
    /// velocity of the robot, then the directions of the last step's middle with their angles, then the corners' states.
    fn save(&self) -> Result<Vec<f64>, EngineError> {
        let bodies = || 0..self.count;
        let mut state: Vec<f64> = bodies().map(|i| self.of_body(i, |quad| quad.angle)).collect();
        state.extend(bodies().flat_map(|i| [0, 1, 2].map(|k| self.of_body(i, |quad| quad.motion[k]))));
        state.extend(self.centre);
        state.extend(self.velocity);
        state.extend(bodies().flat_map(|i| [0, 1].map(|k| self.of_body(i, |quad| quad.along[k]))));
        state.extend(bodies().map(|i| self.of_body(i, |quad| quad.posed)));
        state.extend(self.floor.saved());
        state.extend(self.beyond.iter().flat_map(JointExtensions::saved));
        Ok(state)
    }

    fn load(&mut self, step: u64, state: &[f64]) -> Result<(), EngineError> {
        let count = self.count;
        let corners = self.floor.saved().count();
        let memory = self.beyond.iter().flat_map(JointExtensions::saved).count();
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
            let (quad, lane) = place(i, self.root);
            let at = &mut self.quads[quad];
            at.angle.set_lane(lane, angles[i]);
            at.posed.set_lane(lane, posed[i]);
            (0..3).for_each(|k| at.motion[k].set_lane(lane, motions[3 * i + k]));
            (0..2).for_each(|k| at.along[k].set_lane(lane, along[2 * i + k]));
        }
        self.follow();
        (self.centre, self.velocity) = ([centre[0], centre[1]], [centre[2], centre[3]]);
        self.floor.restore(corners);
        if let Some(beyond) = &mut self.beyond {
            beyond.restore(memory);
        }
        self.finite = false;
        self.step = step;
        Ok(())
    }

    fn actuators(&self) -> usize {
        (self.count - 1) / self.motors_per_actuator
    }

    fn step(&self) -> u64 {
        self.step
    }

    fn clamp_hits(&self) -> Option<ClampHits> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Means;
    use crate::experiment::{self, Source, presets};

    /// The robot's engine after three jumps, in the registers of `level`.
    fn jumped(level: Level) -> PlanarEngine {
        let source = Source::from_text("jump", presets::find("jump-14hz").unwrap().text);
        let experiment = experiment::experiment(&source).unwrap();
        let mut engine = PlanarEngine::new(&experiment.robot, 1e-4).unwrap();
        engine.level = level;
        let mut voltages = vec![0.0; experiment.robot.actuators];
        let mut means = Means::new(&experiment.drive, experiment.robot.actuators, 0.0);
        for step in 0..2200 {
            let time = f64::from(step) * 1e-4;
            means.over(time, time + 1e-4, &mut voltages);
            engine.prepare(&voltages).unwrap();
            engine.advance().unwrap();
        }
        assert!(engine.iterations() > 500, "the robot is on the floor much of the time");
        engine
    }

    fn bits(engine: &PlanarEngine) -> Vec<u64> {
        engine.save().unwrap().into_iter().map(f64::to_bits).collect()
    }

    /// The saved state does not hold bodies without mass, but where they turn decides how directions are computed.
    #[test]
    fn a_restored_engine_has_the_same_turns_in_all_lanes() {
        let engine = jumped(Level::new());
        let source = Source::from_text("jump", presets::find("jump-14hz").unwrap().text);
        let mut restored = PlanarEngine::new(&experiment::experiment(&source).unwrap().robot, 1e-4).unwrap();
        restored.load(engine.step(), &engine.save().unwrap()).unwrap();
        assert!(engine.quads.iter().any(|quad| quad.mass.to_array().contains(&0.0)), "the arms differ in length");
        for (ours, theirs) in restored.quads.iter().zip(&engine.quads) {
            assert_eq!((ours.angle, ours.posed, ours.motion[0]), (theirs.angle, theirs.posed, theirs.motion[0]));
            assert_eq!(ours.along, theirs.along);
        }
    }

    #[test]
    fn bits_do_not_depend_on_the_registers() {
        let narrow = bits(&jumped(Level::baseline()));
        assert_eq!(bits(&jumped(Level::new())), narrow);
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = Level::new().as_avx2() {
            assert_eq!(bits(&jumped(Level::Avx2(avx2))), narrow);
        }
    }
}
