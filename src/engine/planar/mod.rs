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
//! sliding lifts a corner by μ·h·|v_t|, which vanishes with the step. Taking that lift off again by fixed-point iterations (De Saxcé) was tried: it does
//! not converge for the frictions of films (4.0), and changes heights of jumps (friction 1.0) by less than the step does. Newton's method over the corners' states (open,
//! sticking, sliding) puts active corners into the recursion as terms of their bodies' inertia.
//!
//! # References
//!
//! R. Featherstone, *Rigid Body Dynamics Algorithms*, chapter 7 (articulated bodies). D. E. Stewart and J. C. Trinkle, Int. J. Numer. Meth.
//! Eng. 39 (1996) (time stepping with complementarity). M. Anitescu, Math. Program. 105 (2006) (the convex model). A. Castro et al., arXiv
//! 2110.10107 (regularised cones and Newton's method).

mod contact;
mod recursion;
mod statics;

use self::contact::{Corner, Grip, Law};
use self::recursion::{Link, Spatial, solve};
use super::{ClampHits, Contact, Engine, EngineError, JointState, PlanarBase};
use crate::actuator::PiezoJoint;
use crate::analytic;
use crate::model::{Mount, Robot};

/// Bullet's limit on the product of two friction coefficients, kept for equal friction.
const LARGEST_FRICTION: f64 = 10.0;
/// The weight of a step's end over that of its start is 1/2 + this (1/s) times the step, so that what alternates from step to step dies out:
/// a velocity that springs and dampers dictate keeps −(1 − w)/w of an alternation per step. For a mode of angular frequency ω this adds
/// h (w − 1/2) ω/2 to the damping ratio, of second order in h.
const NUMERICAL_DAMPING: f64 = 50.0;
/// The links' directions are computed anew every so many steps and when they turn by more than this (rad), for which the series in
/// [`turned`] are exact to the last digit.
const EXACT_EVERY: u64 = 64;
const LARGEST_SERIES: f64 = 0.1;
/// Newton steps after which a contact problem is given up.
const LARGEST_ITERATIONS: u32 = 100;
/// The search ends where the slope of the cost is this share of the one it began with.
const SEARCH_ENOUGH: f64 = 0.1;
/// Steps of the search along one Newton step; it ends much earlier.
const LARGEST_SEARCH: u32 = 60;

/// A Newton step is the last if the cost falls by less than these shares of m (g h)² and of the kinetic energy: the first is a velocity of
/// 10⁻⁶ of what gravity gives in a step, the second what rounding leaves.
const DONE_OF_GRAVITY: f64 = 1e-12;
const DONE_OF_KINETIC: f64 = 1e-18;

/// The robot as a planar chain.
pub struct PlanarEngine {
    joint: PiezoJoint,
    motors_per_actuator: usize,
    mount: Mount,
    time_step: f64,
    stable_step: f64,
    gravity: f64,
    /// Along x and z (cm/s²).
    pull: [f64; 2],
    mass: f64,
    half_thickness: f64,
    /// Of each body with the floor.
    grips: Vec<Grip>,
    /// Left end of a clamped chain (cm).
    left: [f64; 2],
    root: usize,
    lengths: Vec<f64>,
    /// Of the mass.
    shares: Vec<f64>,
    /// Angle of each body above the x axis, counted anticlockwise (rad): minus the sum of the joint angles.
    angles: Vec<f64>,
    /// Rate of each body (rad/s) and velocity of its centre of mass (cm/s).
    motions: Vec<Spatial>,
    /// Centre of mass (cm) and its velocity (cm/s).
    centre: [f64; 2],
    velocity: [f64; 2],
    links: Vec<Link>,
    /// Angles that the links' directions are of.
    posed: Vec<f64>,
    kept: Vec<[f64; 2]>,
    corners: Vec<Corner>,
    /// Mean motions of the left ends in the iterate of the contact problem.
    iterate: Vec<Spatial>,
    law: Law,
    weight: f64,
    step: u64,
    state: JointState,
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
        robot.check()?;
        let longest = 0.1 / (analytic::cantilever_frequency(robot) * (robot.actuators as f64).powi(2));
        if time_step.is_nan() || time_step > longest {
            return Err(EngineError::StepTooLong { time_step, longest });
        }
        let segments = robot.segments();
        let count = segments.len();
        let joint = robot.joint();
        let thickness = robot.collision_thickness;
        let mass: f64 = segments.iter().map(|segment| segment.mass).sum();
        let weight = (0.5 + NUMERICAL_DAMPING * time_step).min(1.0);
        let implicit = weight * time_step * joint.stiffness * (joint.damping_time + 0.5 * time_step);
        let root = if robot.mount == Mount::Clamped { 0 } else { count / 2 };
        let links = segments
            .iter()
            .enumerate()
            .map(|(i, s)| {
                let side = if i < root { -1.0 } else { 1.0 };
                Link::new(s.length, side, s.mass, s.mass / 12.0 * (s.length.powi(2) + thickness.powi(2)), implicit)
            })
            .collect();
        // The base's centre stands at the origin, as in Bullet.
        let left = -0.5 * segments[0].length;
        let (mut at, mut moment) = (left, 0.0);
        for segment in &segments {
            moment += segment.mass * (at + 0.5 * segment.length);
            at += segment.length;
        }
        let joints = || vec![0.0; count - 1];
        Ok(Self {
            joint,
            motors_per_actuator: robot.motors_per_actuator,
            mount: robot.mount,
            time_step,
            stable_step: analytic::stable_step(robot),
            gravity: robot.material.gravity,
            pull: [0.0, -robot.material.gravity],
            mass,
            half_thickness: 0.5 * thickness,
            grips: segments.iter().map(|s| Grip::new((s.friction * robot.friction.ground).min(LARGEST_FRICTION))).collect(),
            left: [left, 0.0],
            root,
            lengths: segments.iter().map(|s| s.length).collect(),
            shares: segments.iter().map(|s| s.mass / mass).collect(),
            angles: vec![0.0; count],
            motions: vec![[0.0; 3]; count],
            centre: [moment / mass, 0.0],
            velocity: [0.0; 2],
            links,
            posed: vec![0.0; count],
            kept: vec![[0.0; 2]; count],
            corners: vec![Corner::default(); if robot.mount == Mount::Ground { 2 * count } else { 0 }],
            iterate: vec![[0.0; 3]; count],
            law: Law::new(time_step, weight, mass),
            weight,
            step: 0,
            state: JointState { angles: joints(), rates: joints(), torques: joints(), motor_voltages: joints() },
            iterations: 0,
            numerical_loss: 0.0,
        })
    }

    /// Contact problems' Newton iterations over all steps so far; 0 for steps without contact.
    pub fn iterations(&self) -> u64 {
        self.iterations
    }

    /// Lets the floor rise by `angle` (rad) along +x: in its axes gravity is g (−sin, −cos). The books of energy know level floors only.
    pub fn set_slope(&mut self, angle: f64) {
        self.pull = [-self.gravity * angle.sin(), -self.gravity * angle.cos()];
    }

    fn clamped(&self) -> bool {
        self.mount == Mount::Clamped
    }

    /// Turns the links to where they are in the middle of the step if all goes on at its rates.
    ///
    /// They turn on from where they were, by the series of sine and cosine, which is several times faster than computing both anew. That
    /// loses a last digit at times, so it is done every [`EXACT_EVERY`] steps, and where they turn far.
    fn turn(&mut self) {
        let ahead = 0.5 * self.time_step;
        let exact = self.step.is_multiple_of(EXACT_EVERY);
        let states = self.angles.iter().zip(&self.motions).zip(&mut self.posed);
        for (link, ((angle, motion), posed)) in self.links.iter_mut().zip(states) {
            let to = angle + ahead * motion[0];
            let by = to - *posed;
            *posed = to;
            link.along = if exact || by.abs() > LARGEST_SERIES { [to.cos(), to.sin()] } else { turned(link.along, by) };
        }
    }

    /// Shows `look` the links as they stand now.
    fn posed<T>(&mut self, look: impl FnOnce(&Self) -> T) -> T {
        for ((link, kept), angle) in self.links.iter_mut().zip(&mut self.kept).zip(&self.angles) {
            *kept = link.along;
            link.along = [angle.cos(), angle.sin()];
        }
        let seen = look(self);
        for (link, kept) in self.links.iter_mut().zip(&self.kept) {
            link.along = *kept;
        }
        seen
    }

    /// Left end of the chain (cm) as the links are turned, `ahead` (s) of the state.
    fn left_end(&self, ahead: f64) -> [f64; 2] {
        if self.clamped() {
            return self.left;
        }
        let (mut at, mut mean) = ([0.0; 2], [0.0; 2]);
        for ((link, length), share) in self.links.iter().zip(&self.lengths).zip(&self.shares) {
            for k in 0..2 {
                let along = length * link.along[k];
                mean[k] += share * (at[k] + 0.5 * along);
                at[k] += along;
            }
        }
        [0, 1].map(|k| self.centre[k] + ahead * self.velocity[k] - mean[k])
    }

    /// Velocity of the left end (cm/s) as the links are turned, from the rates and the velocity of the centre of mass.
    fn left_velocity(&self) -> [f64; 2] {
        if self.clamped() {
            return [0.0; 2];
        }
        let (mut at, mut mean) = ([0.0; 2], [0.0; 2]);
        for (((link, length), share), motion) in self.links.iter().zip(&self.lengths).zip(&self.shares).zip(&self.motions) {
            let across = [-motion[0] * length * link.along[1], motion[0] * length * link.along[0]];
            for k in 0..2 {
                mean[k] += share * (at[k] + 0.5 * across[k]);
                at[k] += across[k];
            }
        }
        [0, 1].map(|k| self.velocity[k] - mean[k])
    }

    /// Looks which corners may touch during this step; whether any does.
    fn find_corners(&mut self, law: &Law) -> bool {
        let half = self.half_thickness;
        let mut any = false;
        let mut height = self.left_end(0.5 * self.time_step)[1] + half;
        for (i, (pair, link)) in self.corners.chunks_exact_mut(2).zip(&self.links).enumerate() {
            // The side of the box that looks down, and where its ends are from the reference point.
            let down = half.copysign(link.along[0]);
            let (side, drop) = (down * link.along[1], -down * link.along[0]);
            let from = if link.reach < 0.0 { link.reach } else { 0.0 };
            for (k, corner) in pair.iter_mut().enumerate() {
                let reach = from + if k == 0 { 0.0 } else { self.lengths[i] };
                let gap = height + (reach - from) * link.along[1] + drop;
                let arm = [reach * link.along[0] + side, reach * link.along[1] + drop];
                any |= corner.place(arm, gap, self.grips[i], law);
            }
            height += self.lengths[i] * link.along[1];
        }
        if !any {
            return false;
        }
        let mut velocity = self.left_velocity();
        for (((pair, link), motion), length) in
            self.corners.chunks_exact_mut(2).zip(&self.links).zip(&self.motions).zip(&self.lengths)
        {
            let rate = motion[0];
            let end = [velocity[0] - rate * length * link.along[1], velocity[1] + rate * length * link.along[0]];
            let reference = if link.reach < 0.0 { end } else { velocity };
            for corner in pair.iter_mut().filter(|corner| corner.near) {
                corner.begin([reference[0] - rate * corner.arm[1], reference[1] + rate * corner.arm[0]], law);
            }
            velocity = end;
        }
        true
    }

    /// Solves the step's mean motion into the links, with Newton's method over the corners' states.
    ///
    /// The cost ½ uᵀAu − uᵀb + Σ R/2 |λ|² is convex with piecewise linear gradient. A Newton step solves for the linear pieces of the
    /// iterate; if the solution lies on the same pieces it is exact, otherwise the cost is minimised along the way there.
    fn solve_contact(&mut self, law: &Law) -> Result<(), EngineError> {
        for iteration in 1..=LARGEST_ITERATIONS {
            self.iterations += 1;
            solve(&mut self.links, self.root, false, &self.corners, law);
            let mut agrees = true;
            for (corners, link) in self.corners.chunks_exact_mut(2).zip(&self.links) {
                for corner in corners.iter_mut().filter(|corner| corner.near) {
                    agrees &= corner.agrees(&link.mean, law);
                }
            }
            if agrees {
                return Ok(());
            }
            let search = if iteration == 1 { Search::Whole } else { self.search(law) };
            if search == Search::Done {
                return Ok(());
            }
            if search == Search::Whole {
                // The states that it was solved for were a guess: any motion will do for an iterate.
                for (i, link) in self.links.iter().enumerate() {
                    self.iterate[i] = link.mean;
                    for corner in self.corners[2 * i..2 * i + 2].iter_mut().filter(|corner| corner.near) {
                        corner.accept(&link.mean, law);
                    }
                }
            }
        }
        let time = self.step as f64 * self.time_step;
        Err(EngineError::NotConverged { iterations: LARGEST_ITERATIONS, step: self.step, time })
    }

    /// Minimises the cost between the iterate and the links' mean motion, and moves the iterate there.
    ///
    /// With d the way, f'(t) = λ₁·d − (1 − t) dᵀAd − λ(t)·d, where λ₁ is the impulse at the end by the iterate's linear pieces.
    fn search(&mut self, law: &Law) -> Search {
        let (mut metric, mut end) = (0.0, 0.0);
        let mut kinetic = 0.0;
        let mut turn_before = 0.0;
        for (i, link) in self.links.iter().enumerate() {
            let from = self.iterate[i];
            let d = [0, 1, 2].map(|k| link.mean[k] - from[k]);
            let half = 0.5 * link.reach * d[0];
            let (x, z) = (d[1] - half * link.along[1], d[2] + half * link.along[0]);
            metric += link.mass * (x * x + z * z) + link.inertia * d[0] * d[0];
            let [turn, x, z] = link.mean_of_centre();
            kinetic += link.mass * (x * x + z * z) + link.inertia * turn * turn;
            if i > 0 {
                // All joints are alike.
                metric += link.implicit * (d[0] - turn_before).powi(2);
            }
            turn_before = d[0];
            for corner in self.corners[2 * i..2 * i + 2].iter_mut().filter(|corner| corner.near) {
                end += corner.aim(&link.mean, law);
            }
        }
        let slope_at = |t: f64| {
            let (mut first, mut second) = (end - (1.0 - t) * metric, metric);
            for corner in self.corners.iter().filter(|corner| corner.near) {
                let (along, slope) = corner.search(t, law);
                first -= along;
                second -= slope;
            }
            (first, second)
        };
        let weight = self.gravity * self.time_step;
        let start = -slope_at(0.0).0;
        if start <= DONE_OF_GRAVITY * self.mass * weight * weight + DONE_OF_KINETIC * kinetic {
            return Search::Done;
        }
        let enough = SEARCH_ENOUGH * start;
        let (mut low, mut high, mut t) = (0.0, 1.0, 1.0);
        let mut found = 1.0;
        for _ in 0..LARGEST_SEARCH {
            let (first, second) = slope_at(t);
            found = t;
            if first > 0.0 {
                high = t;
            } else {
                low = t;
            }
            if first.abs() <= enough || (t == 1.0 && first < 0.0) {
                break;
            }
            let next = t - first / second;
            t = if next > low && next < high { next } else { 0.5 * (low + high) };
            if t == found || high - low <= f64::EPSILON * high {
                break;
            }
        }
        if found == 1.0 {
            return Search::Whole;
        }
        for (i, link) in self.links.iter().enumerate() {
            for k in 0..3 {
                self.iterate[i][k] += found * (link.mean[k] - self.iterate[i][k]);
            }
            for corner in self.corners[2 * i..2 * i + 2].iter_mut().filter(|corner| corner.near) {
                corner.go(found, law);
            }
        }
        Search::Part
    }
}

/// A direction turned by a small angle (rad), at unit length.
fn turned([x, z]: [f64; 2], by: f64) -> [f64; 2] {
    let s = by * by;
    let sin = by * (1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0))));
    let cos = 1.0 - s / 2.0 * (1.0 - s / 12.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0)));
    let (x, z) = (x * cos - z * sin, x * sin + z * cos);
    let scale = 1.5 - 0.5 * (x * x + z * z);
    [x * scale, z * scale]
}

/// How a search along a Newton step ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Search {
    /// The cost cannot fall any more.
    Done,
    /// The lowest cost is at the end of the step.
    Whole,
    /// It is on the way.
    Part,
}

impl Engine for PlanarEngine {
    fn prepare(&mut self, voltages: &[f64]) -> Result<(), EngineError> {
        let m = self.motors_per_actuator as f64;
        let mut sum = 0.0;
        for i in 0..self.state.angles.len() {
            // Joint angles count the other way round.
            let angle = self.angles[i] - self.angles[i + 1];
            let rate = self.motions[i][0] - self.motions[i + 1][0];
            let volts = voltages[i / self.motors_per_actuator] / m;
            self.state.angles[i] = angle;
            self.state.rates[i] = rate;
            self.state.motor_voltages[i] = volts;
            self.state.torques[i] = self.joint.torque(angle, rate, volts);
            sum += 0.0 * angle + 0.0 * rate;
        }
        sum += 0.0 * (self.centre[0] + self.centre[1] + self.velocity[0] + self.velocity[1]);
        if sum == 0.0 {
            return Ok(());
        }
        let bad = self.state.angles.iter().zip(&self.state.rates).position(|(a, r)| !(a + r).is_finite());
        let what =
            bad.map_or_else(|| "the centre of mass".to_owned(), |joint| format!("the angle or rate of joint {}", joint + 1));
        let time = self.step as f64 * self.time_step;
        Err(EngineError::NotFinite { what, value: f64::NAN, step: self.step, time, stable_step: self.stable_step })
    }

    fn joints(&self) -> &JointState {
        &self.state
    }

    /// Positions and velocities of the same time, unlike the reference's.
    fn nodes(&mut self, positions: &mut [f64], velocities: &mut [f64]) -> Result<(), EngineError> {
        self.posed(|engine| {
            let mut velocity = engine.left_velocity();
            let mut position = engine.left_end(0.0);
            let ends = engine.links.iter().zip(&engine.motions).zip(&engine.lengths).map(|((link, motion), length)| {
                let across = [-motion[0] * length * link.along[1], motion[0] * length * link.along[0]];
                (link.along.map(|a| a * length), across)
            });
            let rows = positions.chunks_exact_mut(3).zip(velocities.chunks_exact_mut(3));
            for ((node, node_velocity), (along, across)) in rows.zip(ends.chain([([0.0; 2], [0.0; 2])])) {
                node.copy_from_slice(&[position[0], 0.0, position[1]]);
                node_velocity.copy_from_slice(&[velocity[0], 0.0, velocity[1]]);
                for k in 0..2 {
                    position[k] += along[k];
                    velocity[k] += across[k];
                }
            }
        });
        Ok(())
    }

    fn base(&mut self) -> Result<PlanarBase, EngineError> {
        Ok(self.posed(|engine| {
            let rate = engine.motions[0][0];
            let half = engine.links[0].along.map(|along| 0.5 * engine.lengths[0] * along);
            let (position, velocity) = (engine.left_end(0.0), engine.left_velocity());
            PlanarBase {
                position: [0, 1].map(|k| position[k] + half[k]),
                pitch: -engine.angles[0],
                velocity: [velocity[0] - rate * half[1], velocity[1] + rate * half[0]],
                pitch_rate: -rate,
            }
        }))
    }

    fn contacts(&mut self, contacts: &mut Vec<Contact>) -> Result<(), EngineError> {
        contacts.clear();
        self.posed(|engine| {
            let mut left = engine.left_end(0.0);
            for (i, (pair, link)) in engine.corners.chunks_exact(2).zip(&engine.links).enumerate() {
                let right = [0, 1].map(|k| left[k] + engine.lengths[i] * link.along[k]);
                for corner in pair {
                    let impulse = corner.impulse(&engine.law);
                    if impulse[1] > 0.0 {
                        let reference = if link.reach < 0.0 { right } else { left };
                        let position = [0, 1].map(|k| reference[k] + corner.arm[k]);
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
        self.turn();
        let joints = self.state.angles.iter().zip(&self.state.motor_voltages);
        for (i, (angle, volts)) in joints.enumerate() {
            // Spring and drive at the start; the implicit part adds what the mean rate makes.
            let torque = share * self.joint.torque(*angle, 0.0, *volts);
            if i < self.root {
                self.links[i].torque = torque;
            } else {
                self.links[i + 1].torque = -torque;
            }
        }
        let pull = self.pull.map(|part| share * part);
        for (link, [rate, x, z]) in self.links.iter_mut().zip(&self.motions) {
            link.momentum = [link.inertia * rate, link.mass * (x + pull[0]), link.mass * (z + pull[1])];
        }
        let law = self.law;
        if self.find_corners(&law) {
            self.solve_contact(&law)?;
        } else {
            solve(&mut self.links, self.root, self.mount == Mount::Clamped, &[], &self.law);
        }
        let per_weight = 1.0 / self.weight;
        let (mut momentum, mut change_squared) = ([0.0; 2], 0.0);
        for ((link, motion), angle) in self.links.iter().zip(&mut self.motions).zip(&mut self.angles) {
            let mean = link.mean_of_centre();
            *angle += h * mean[0];
            let change = [0, 1, 2].map(|k| (mean[k] - motion[k]) * per_weight);
            for k in 0..3 {
                motion[k] += change[k];
            }
            change_squared += link.inertia * change[0] * change[0] + link.mass * (change[1] * change[1] + change[2] * change[2]);
            momentum[0] += link.mass * motion[1];
            momentum[1] += link.mass * motion[2];
        }
        self.numerical_loss += (self.weight - 0.5) * change_squared;
        if !self.clamped() {
            for k in 0..2 {
                let after = momentum[k] / self.mass;
                self.centre[k] += h * (self.velocity[k] + self.weight * (after - self.velocity[k]));
                self.velocity[k] = after;
            }
        }
        self.step += 1;
        Ok(())
    }

    fn midpoint(&self) -> bool {
        true
    }

    fn kinetic_energy(&self) -> Option<f64> {
        Some(
            self.links
                .iter()
                .zip(&self.motions)
                .map(|(link, [rate, x, z])| 0.5 * (link.mass * (x * x + z * z) + link.inertia * rate * rate))
                .sum(),
        )
    }

    fn numerical_loss(&self) -> f64 {
        self.numerical_loss
    }

    /// Angles of the bodies (rad, anticlockwise), then rate (rad/s) and velocity of the centre of mass (cm/s) of each, then centre of mass and
    /// velocity of the robot, then the corners' states, then the directions of the last step's middle.
    fn save(&self) -> Result<Vec<f64>, EngineError> {
        let mut state = self.angles.clone();
        state.extend(self.motions.iter().flatten());
        state.extend(self.centre);
        state.extend(self.velocity);
        state.extend(self.corners.iter().map(Corner::saved));
        state.extend(&self.posed);
        state.extend(self.links.iter().flat_map(|link| link.along));
        Ok(state)
    }

    fn load(&mut self, step: u64, state: &[f64]) -> Result<(), EngineError> {
        let count = self.angles.len();
        if state.len() != 7 * count + 4 + self.corners.len() || state.iter().any(|value| !value.is_finite()) {
            return Err(EngineError::State);
        }
        let (angles, rest) = state.split_at(count);
        let (motions, rest) = rest.split_at(3 * count);
        self.angles.copy_from_slice(angles);
        for (motion, saved) in self.motions.iter_mut().zip(motions.chunks_exact(3)) {
            motion.copy_from_slice(saved);
        }
        (self.centre, self.velocity) = ([rest[0], rest[1]], [rest[2], rest[3]]);
        let (corners, rest) = rest[4..].split_at(self.corners.len());
        for (corner, saved) in self.corners.iter_mut().zip(corners) {
            corner.restore(*saved);
        }
        let (posed, along) = rest.split_at(count);
        self.posed.copy_from_slice(posed);
        for (link, saved) in self.links.iter_mut().zip(along.chunks_exact(2)) {
            link.along.copy_from_slice(saved);
        }
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
