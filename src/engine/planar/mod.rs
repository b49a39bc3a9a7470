//! The robot in the plane: springs and dampers implicit, contact by time stepping, every step linear in the number of links.
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
//! with the Jacobian J at the pose that the old rates lead to in the middle of the step. Springs, dampers and drives act at that middle. M
//! is constant, for V are the bodies' own velocities. k and η are diagonal in the joints, so they only add to each joint's articulated
//! inertia, and the articulated-body algorithm solves a step in a tip-to-base and a base-to-tip pass ([`recursion`]).
//!
//! With w = 1/2 this is the midpoint rule: of second order where nothing touches, stable at any step, and it makes no energy, whatever the
//! pose in J: V⁺ᵀMV⁺ − VᵀMV = 2 h u·(forces), and springs give back what they took. So does gravity if the robot is not clamped, for
//! its height is the centre of mass's own coordinate. (A clamped robot's gravity closes to third order in h per step.) w is a little more than 1/2, see
//! [`NUMERICAL_DAMPING`]; the energy audit counts what that dissipates.
//!
//! # Contact
//!
//! The two bottom corners of every box may touch the floor. In velocities v⁺ at the end of the step, with a look-ahead of one step,
//!
//! ```text
//! 0 ≤ v_n⁺ + gap/h + c λ_n/h  ⊥  λ_n ≥ 0,        |λ_t| ≤ μ λ_n
//! ```
//!
//! so a corner never passes the floor: it stops on it, without bounce. v⁺ is taken in the pose of the end. J V⁺ is in the pose of the middle; in between, the
//! corner's velocity turns by h/2 of its acceleration at constant rates, without which a corner that stands still on a turning body would creep, an error of
//! first order. The compliance c only decides how a weight is shared among many corners ([`law`]).
//!
//! These are the time steps of Stewart and Trinkle and of Moreau and Jean, with the midpoint rule between them. Steps are cut where corners land
//! ([`landing`]). Newton's method over the corners' contact modes (open, sticking, sliding either way) starts from those of the step before and puts active
//! corners into the recursion as terms of their bodies' inertia ([`newton`]). Where it cycles, a path is followed that changes one contact mode at a time
//! ([`path`]), in the end Lemke's from open corners. A step that is not solved to rounding is an error. Where Coulomb's law has several solutions
//! (Painlevé), the first of these methods that finds one decides.
//!
//! [`FrictionModel::Convex`] is Anitescu's convex model instead: its minimum is unique, and sliding lifts a corner by μ·h·|v_t|, which
//! vanishes with the step. In long chains, parts in which modes change are solved on their own in between.
//!
//! # References
//!
//! R. Featherstone, *Rigid Body Dynamics Algorithms*, chapter 7 (articulated bodies). D. E. Stewart and J. C. Trinkle, Int. J. Numer. Meth.
//! Eng. 39 (1996) (time stepping with complementarity). M. Anitescu, Math. Program. 105 (2006) (the convex model). A. Castro et al., arXiv
//! 2110.10107 (regularised cones and Newton's method).

mod attachment;
mod contact;
mod floor;
mod interface;
mod joint_extensions;
mod joints;
mod landing;
mod lanes;
mod law;
mod newton;
mod path;
mod pose;
mod quad;
mod recursion;
mod state;
mod statics;
mod step;

use std::cmp::Ordering;

use fearless_simd::Level;
use wide::f64x2;

use self::attachment::Attachments;
use self::floor::{Floor, Surface};
use self::joint_extensions::JointExtensions;
use self::lanes::Lanes;
use self::law::ContactLaw;
pub use self::law::FrictionModel;
use self::newton::{LARGEST_STEPS, LONGEST_WHOLE, MORE_PER_BODY};
use self::quad::Quad;
use self::recursion::{BLOCK, BaseJoint, Clamp, Distal, Slide, Turn};
use self::step::{set_implicit, weight_of};
use super::{ClampHits, Contact, EnergyTerms, Engine, EngineError, JointState, LARGEST_FRICTION, PlanarBase, Posed};
use crate::actuator::PiezoJoint;
use crate::analytic;
use crate::model::{Mount, RigidBody, Robot, Segment};

/// The weight w of a step's end is 1/2 + this (1/s) times the step, so that alternations from step to step die out: a velocity that springs and dampers
/// dictate keeps −(1 − w)/w of an alternation per step. For a mode of angular frequency ω this adds h (w − 1/2) ω/2 to the damping ratio, of second order in h.
pub(crate) const NUMERICAL_DAMPING: f64 = 50.0;
/// Largest magnitude of angles (rad), rates, positions and velocities (CGS), so that their squares are finite.
const LARGEST_COORDINATE: f64 = 1e100;

/// The robot as a planar chain.
pub struct PlanarEngine {
    joint: PiezoJoint,
    motors_per_actuator: usize,
    mount: Mount,
    base_joint: BaseJoint,
    /// Rest angle of each joint at 0 V (rad), and factor on its voltage; empty in the plain model.
    rest_angles: Vec<f64>,
    gains: Vec<f64>,
    extensions: Option<Box<JointExtensions>>,
    attachments: Option<Attachments>,
    time_step: f64,
    gravity: f64,
    /// Acceleration by gravity along x and z (cm/s²).
    gravity_vector: [f64; 2],
    mass: f64,
    /// Number of bodies, and index of the root.
    count: usize,
    root: usize,
    lengths: Vec<f64>,
    quads: Vec<Quad>,
    /// Number of tree levels. If it is odd, the last quad has a level of padding.
    levels: usize,
    /// Two vectors per body, for the directions set aside while a pose is read, or for the links' vectors.
    scratch: Vec<[Lanes; 2]>,
    /// Centre of mass (cm) and its velocity (cm/s). A clamped chain has its left end here.
    centre: [f64; 2],
    velocity: [f64; 2],
    /// Without corners unless the robot is on the ground.
    floor: Floor,
    /// Mean motions of the reference points in the iterate of the contact problem.
    iterate: Vec<[Lanes; 3]>,
    /// Newton steps after which a contact problem is an error.
    largest_steps: u32,
    /// Distal articulated inertia and bias force of each block of levels, in chains on the ground that are long enough to be solved in parts; empty otherwise.
    distal: Vec<Distal>,
    /// Blocks with corners whose mode a solution changes.
    blocks_with_changed_modes: Vec<bool>,
    law: ContactLaw,
    /// w of the scheme.
    weight: f64,
    /// (w − 1/2) over the step (1/s).
    numerical_damping: f64,
    /// The machine's registers.
    level: Level,
    step: u64,
    /// The joints when they were last read, but for the voltages, which are always those of [`prepare`](Engine::prepare).
    state: JointState,
    /// The actuators' voltages of the last [`prepare`](Engine::prepare) (V).
    voltages: Vec<f64>,
    /// True if the state is known to be finite, because the changes of the last step were.
    finite: bool,
    /// See [`EnergyTerms`](crate::engine::EnergyTerms), as `numerical_loss`.
    work_sums: [f64; 2],
    /// Newton iterations of all steps so far.
    iterations: u64,
    /// Paths followed so far.
    paths: u64,
    path: Vec<path::Pair>,
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

    /// [`new`](Self::new) with another weight of the step's end: ½ + `damping` (1/s) times the step. Less is more exact for a robot that touches nothing.
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
        let extensions = &robot.extensions;
        let (segments, bodies, joint) = (robot.segments(), robot.rigid_bodies(), robot.joint());
        let count = segments.len();
        let mass: f64 = bodies.iter().map(|body| body.mass).sum();
        let weight = weight_of(damping, time_step);
        let root = if robot.mount == Mount::Clamped { 0 } else { count / 2 };
        let levels = root.max(count - 1 - root) + 1;
        let blocks = if robot.mount == Mount::Ground && levels > LONGEST_WHOLE { levels.div_ceil(BLOCK) } else { 0 };
        let (mut quads, frictions) = bodies_in_quads(robot, &segments, &bodies, root, levels);
        let mut base_joint = base_joint(robot);
        if let Some(Turn::Hinged { .. }) = base_joint.turn() {
            quads[0].stiffness.set_lane(0, 1.0 / extensions.clamp_compliance);
        }
        set_implicit(&mut quads, &joint, &mut base_joint, weight, time_step);
        let m = robot.motors_per_actuator;
        let rest_angles =
            extensions.rest_curvature.iter().flat_map(|curvature| vec![curvature * robot.link_length(); m]).collect();
        let joints = || vec![0.0; count - 1];
        let mut engine = Self {
            joint,
            motors_per_actuator: m,
            mount: robot.mount,
            base_joint,
            rest_angles,
            gains: extensions.joint_gains.clone(),
            extensions: JointExtensions::new(extensions, robot.material.width, robot.link_length(), time_step, &quads),
            attachments: Attachments::new(robot, root),
            time_step,
            gravity: robot.material.gravity,
            gravity_vector: gravity_vector(robot.material.gravity, extensions.slope),
            mass,
            count,
            root,
            lengths: segments.iter().map(|segment| segment.length).collect(),
            scratch: vec![[Lanes::ZERO; 2]; quads.len()],
            centre: first_centre(robot, &segments, &bodies),
            velocity: [0.0; 2],
            floor: if robot.mount == Mount::Ground {
                Floor::new(&frictions, 0.5 * robot.collision_thickness, Surface::new(extensions))
            } else {
                Floor::new(&[], 0.0, None)
            },
            iterate: vec![[Lanes::ZERO; 3]; quads.len()],
            largest_steps: LARGEST_STEPS + MORE_PER_BODY * count as u32,
            distal: vec![Distal::default(); blocks],
            blocks_with_changed_modes: vec![false; blocks],
            quads,
            levels,
            law: ContactLaw::new(time_step, weight, mass / count as f64, FrictionModel::default()),
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

    /// Newton iterations of all contact problems so far; steps without contact take none.
    pub fn iterations(&self) -> u64 {
        self.iterations
    }

    /// Number of paths followed so far where Newton's method cycled: seldom more than one in a step.
    pub fn paths(&self) -> u64 {
        self.paths
    }

    /// Chooses the law of friction.
    pub fn set_friction_model(&mut self, friction: FrictionModel) {
        self.law.friction = friction;
        self.law.landing_speed = self.landing_speed();
    }

    /// Lets the floor rise by `angle` (rad) along +x: in its axes gravity is g (−sin, −cos). The energy audit knows level floors only.
    pub fn set_slope(&mut self, angle: f64) {
        self.gravity_vector = gravity_vector(self.gravity, angle);
    }

    /// Lifts a free robot by `height` (cm).
    pub(crate) fn raise(&mut self, height: f64) {
        if !self.clamped() {
            self.centre[1] += height;
            self.finite = false;
        }
    }

    fn clamped(&self) -> bool {
        self.mount == Mount::Clamped
    }

    /// Velocity in z of a clamped root's reference point (cm/s): none unless the clamp gives.
    fn slide_velocity(&self) -> f64 {
        if !self.base_joint.slides() {
            return 0.0;
        }
        let root = &self.quads[0];
        root.motion[2].lane(0) - root.motion[0].lane(0) * root.half[0].lane(0)
    }

    /// One number of body `i`.
    fn of_body(&self, i: usize, what: impl Fn(&Quad) -> Lanes) -> f64 {
        let (quad, lane) = place(i, self.root);
        what(&self.quads[quad]).lane(lane)
    }
}

/// How the root of `robot` is joined to the world; what depends on the length of the step is set with it.
fn base_joint(robot: &Robot) -> BaseJoint {
    if robot.mount != Mount::Clamped {
        return BaseJoint::Free;
    }
    let extensions = &robot.extensions;
    let damping_time = extensions.clamp_damping;
    let turn = match extensions.curved_clamp() {
        Some(curve) => Turn::Curved { curve, damping_time, ahead: 0.0, share: 0.0 },
        None if extensions.clamp_compliance > 0.0 => Turn::Hinged { damping_time },
        None => Turn::Rigid,
    };
    let slide = (extensions.clamp_shift > 0.0).then(|| Slide {
        stiffness: 1.0 / extensions.clamp_shift,
        damping_time: extensions.clamp_shift_damping,
        implicit: 0.0,
        impulse: 0.0,
    });
    BaseJoint::Clamped(Clamp { turn, slide })
}

/// The bodies of `robot` in quads, and the coefficients of friction of each tree level's bodies.
fn bodies_in_quads(
    robot: &Robot,
    segments: &[Segment],
    bodies: &[RigidBody],
    root: usize,
    levels: usize,
) -> (Vec<Quad>, Vec<[f64; 2]>) {
    let (joint, mass): (_, f64) = (robot.joint(), bodies.iter().map(|body| body.mass).sum());
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
        // Of the joint at the body's reference point; the root has none.
        let own = match i.cmp(&root) {
            Ordering::Less => Some(i),
            Ordering::Equal => None,
            Ordering::Greater => Some(i - 1),
        };
        let factor = own.and_then(|own| robot.extensions.joint_stiffness.get(own)).copied().unwrap_or(1.0);
        at.stiffness.set_lane(lane, joint.stiffness * factor);
        frictions[2 * quad + lane / 2][lane % 2] = (segment.friction * robot.friction.ground).min(LARGEST_FRICTION);
    }
    for quad in &mut quads {
        let half = quad.middle * quad.reach;
        quad.inertia_at_reference = quad.inertia + quad.mass * half * half;
    }
    set_levers(&mut quads);
    (quads, frictions)
}

/// Centre of mass (cm) of the flat robot, with the base's centre at the origin, as in Bullet; of a clamped one the left end.
fn first_centre(robot: &Robot, segments: &[Segment], bodies: &[RigidBody]) -> [f64; 2] {
    let left = -0.5 * segments[0].length;
    if robot.mount == Mount::Clamped {
        return [left, 0.0];
    }
    let mass: f64 = bodies.iter().map(|body| body.mass).sum();
    let (mut at, mut moment) = (left, 0.0);
    for (segment, body) in segments.iter().zip(bodies) {
        moment += body.mass * (at + body.middle * segment.length);
        at += segment.length;
    }
    [moment / mass, 0.0]
}

/// Sets the levers: a body's own share of the mass acts at its centre of mass, all more distal shares at its far end.
fn set_levers(quads: &mut [Quad]) {
    let mut outside = f64x2::ZERO;
    for k in (0..2 * quads.len()).rev() {
        let (quad, level) = (&mut quads[k / 2], k % 2);
        if k == 0 {
            // The right arm hangs on the root's far end.
            outside = f64x2::splat(outside.to_array()[1]);
        }
        let share = quad.share.level(level);
        quad.lever.set_level(level, quad.reach.level(level) * (share * quad.middle.level(level) + outside));
        outside += share;
    }
}

/// Gravity along x and z (cm/s²), in the axes of a floor that rises by `slope` (rad) along +x.
fn gravity_vector(gravity: f64, slope: f64) -> [f64; 2] {
    if slope == 0.0 { [0.0, -gravity] } else { [-gravity * slope.sin(), -gravity * slope.cos()] }
}

/// Quad and lane of body `i` of a chain with this root.
fn place(i: usize, root: usize) -> (usize, usize) {
    let (level, arm) = if i <= root { (root - i, 0) } else { (i - root, 1) };
    (level / 2, 2 * (level % 2) + arm)
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

    /// The saved state does not hold padding lanes, but their angles decide how directions are computed.
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
