//! Stepping a robot in time.
//!
//! An [`Engine`] steps one robot. Each step begins with [`prepare`](Engine::prepare), which takes the voltages and checks that the joints are finite, and ends
//! with [`advance`](Engine::advance); between the two the state before the step can be observed. The loop over steps is [`experiment::run`](crate::experiment::run).

mod affected;
#[cfg(feature = "bullet")]
mod bullet;
mod energy;
mod planar;

pub use affected::AffectedEngine;
#[cfg(feature = "bullet")]
pub use bullet::BulletEngine;
pub use energy::{EnergyAudit, EnergyBalance, EnergyFault, PlanarBase, TOLERANCE as ENERGY_TOLERANCE};
pub(crate) use planar::NUMERICAL_DAMPING;
pub use planar::{FrictionModel, PlanarEngine};

use thiserror::Error;

use crate::model::{ModelError, Mount, Robot};

/// Bullet's limit on the product of two friction coefficients, which the planar engine keeps for equal friction.
pub(crate) const LARGEST_FRICTION: f64 = 10.0;

/// Gauss points along a body, from −1 to 1, with their weights: exact for the square of a linear speed of one sign.
const GAUSS: [(f64, f64); 3] = [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];

/// A simulation that went wrong.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EngineError {
    /// The robot cannot be built.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Bullet refused a call.
    #[cfg(feature = "bullet")]
    #[error(transparent)]
    Bullet(#[from] crate::bullet::BulletError),
    /// An experiment on Bullet, in a build without it.
    #[error(
        "this build has no Bullet, the default engine of experiment files: set simulation.engine = \"planar\", or build with the feature \"bullet\""
    )]
    NoBullet,
    /// The contact problem of a step was not solved.
    #[error(
        "contact was not solved in {iterations} iterations at step {step}, t = {time} s; try a smaller time step, or simulation.friction = \"convex\" for long chains"
    )]
    NotConverged {
        /// Iterations done.
        iterations: u32,
        /// The step, counting from 0.
        step: u64,
        /// The time of the step (s).
        time: f64,
    },
    /// A time step that the robot's slowest motion cannot be seen with.
    #[error(
        "the time step {} s is too long for this robot: at most {longest:.2e} s, a tenth of the period of one actuator's first mode",
        crate::words::number(*.time_step)
    )]
    StepTooLong {
        /// The step (s).
        time_step: f64,
        /// The longest (s).
        longest: f64,
    },
    /// Adaptive steps on an engine with a fixed step.
    #[error("this engine's steps are all of one length; adaptive steps need engine = \"planar\"")]
    FixedStep,
    /// A time step that is not positive.
    #[error("the time step is {time_step} s, but must be a positive number")]
    TimeStep {
        /// The step (s).
        time_step: f64,
    },
    /// Another number of voltages than actuators.
    #[error("{given} voltages for a robot of {needed} actuators")]
    Voltages {
        /// How many there are.
        given: usize,
        /// How many there must be.
        needed: usize,
    },
    /// A slice of the wrong length.
    #[error("{given} numbers for {what}, which needs {needed}")]
    Length {
        /// What the slice is for.
        what: &'static str,
        /// Its length.
        given: usize,
        /// The length needed.
        needed: usize,
    },
    /// A result that is not converged.
    #[error("{0}")]
    NotResolved(String),
    /// A robot without equilibrium.
    #[error("there is no equilibrium to start from: {reason}")]
    NoEquilibrium {
        /// Why.
        reason: String,
    },
    /// A saved state of another robot.
    #[error("the state does not fit this robot")]
    State,
    /// A coordinate is not finite.
    #[error("the simulation diverged: {what} is {value} at step {step}, t = {time} s; try {}", shorter(*.stable_step))]
    NotFinite {
        /// The coordinate: a joint with its number, or the base.
        what: String,
        /// Its value.
        value: f64,
        /// The step, counting from 0.
        step: u64,
        /// The time of the step (s).
        time: f64,
        /// The largest step for which the explicit torque law is stable (s), of an engine that has it.
        stable_step: Option<f64>,
    },
}

impl EngineError {
    fn unless_step(time_step: f64) -> Result<(), Self> {
        if time_step.is_finite() && time_step > 0.0 { Ok(()) } else { Err(Self::TimeStep { time_step }) }
    }

    /// This error with another step and time (s).
    pub(crate) fn at(mut self, (at_step, at_time): (u64, f64)) -> Self {
        if let Self::NotConverged { step, time, .. } | Self::NotFinite { step, time, .. } = &mut self {
            (*step, *time) = (at_step, at_time);
        }
        self
    }

    fn unless_length(what: &'static str, given: usize, needed: usize) -> Result<(), Self> {
        if given == needed { Ok(()) } else { Err(Self::Length { what, given, needed }) }
    }

    fn unless_voltages(given: usize, needed: usize) -> Result<(), Self> {
        if given == needed { Ok(()) } else { Err(Self::Voltages { given, needed }) }
    }
}

/// What to try where a simulation diverged.
fn shorter(stable_step: Option<f64>) -> String {
    stable_step.map_or_else(|| "a smaller time step".into(), |step| format!("a time step below {step:.3e} s"))
}

/// The joints at the start of a step.
#[derive(Debug, PartialEq, Default)]
pub struct JointState {
    /// Angles (rad).
    pub angles: Vec<f64>,
    /// Rates (rad/s).
    pub rates: Vec<f64>,
    /// Torques of the coming step (dyn·cm).
    pub torques: Vec<f64>,
    /// Voltage on each joint: the actuator's, divided by m (V).
    pub motor_voltages: Vec<f64>,
}

impl Clone for JointState {
    fn clone(&self) -> Self {
        let mut copy = Self::default();
        copy.clone_from(self);
        copy
    }

    /// Without allocating where the lengths are the same.
    fn clone_from(&mut self, source: &Self) {
        self.angles.clone_from(&source.angles);
        self.rates.clone_from(&source.rates);
        self.torques.clone_from(&source.torques);
        self.motor_voltages.clone_from(&source.motor_voltages);
    }
}

/// Steps in which Bullet limited a velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClampHits {
    /// Steps after which a velocity stood at the limit.
    pub steps: u64,
    /// The first of them, counting from 0.
    pub first_step: u64,
    /// The limit (cm/s or rad/s).
    pub limit: f64,
}

/// A force of the floor on a link during the last step, in the plane of motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// The link, from 0 for the body at the left end.
    pub link: usize,
    /// Where it acts: x and z (cm).
    pub position: [f64; 2],
    /// Along x (friction) and z (normal) (dyn), the mean over the step.
    pub force: [f64; 2],
}

/// Energies that an engine whose forces act at the middle of steps knows exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyTerms {
    /// Kinetic energy (erg).
    pub kinetic: f64,
    /// Gravitational energy (erg) above an arbitrary level; absent for a clamped robot, where the motion of the joints gives it as exactly.
    pub gravitational: Option<f64>,
    /// Sums over the joints and all steps of voltage times turn (V·rad) and of the turn's square over the step (rad²/s).
    pub work_sums: [f64; 2],
    /// Energy that the time stepping has dissipated since the engine was built (erg).
    pub numerical_loss: f64,
}

/// A robot at rest with given joint angles, level at its left end, which lies where that of the flat robot does but for the lift.
struct Posed {
    /// Direction of every body (rad, anticlockwise).
    directions: Vec<f64>,
    /// Centre of mass (cm), with the base's centre at the origin before the lift.
    centre: [f64; 2],
    /// How far it is lifted so that its lowest point touches the floor (cm); 0 without a floor.
    lift: f64,
}

impl Posed {
    fn new(robot: &Robot, angles: &[f64]) -> Result<Self, EngineError> {
        EngineError::unless_length("the joints' angles", angles.len(), robot.joints())?;
        let (segments, bodies) = (robot.segments(), robot.rigid_bodies());
        let half = 0.5 * robot.collision_thickness;
        let mut at = [-0.5 * segments[0].length, 0.0];
        let (mut direction, mut lowest, mut moment, mut mass) = (0.0, 0.0_f64, [0.0; 2], 0.0);
        let mut directions = Vec::with_capacity(segments.len());
        for (i, (segment, body)) in segments.iter().zip(&bodies).enumerate() {
            if i > 0 {
                direction -= angles[i - 1];
            }
            directions.push(direction);
            let along = [direction.cos() * segment.length, direction.sin() * segment.length];
            // The lower edges of both faces, below those of the flat robot.
            let edge = half - half * direction.cos().abs();
            for end in [at[1], at[1] + along[1]] {
                lowest = lowest.min(end + edge);
            }
            for k in 0..2 {
                moment[k] += body.mass * (at[k] + body.middle * along[k]);
                at[k] += along[k];
            }
            mass += body.mass;
        }
        let lift = if robot.mount == Mount::Ground { -lowest } else { 0.0 };
        Ok(Self { directions, centre: moment.map(|moment| moment / mass), lift })
    }
}

/// A robot that can be stepped.
pub trait Engine: Send {
    /// Takes the voltages of the coming step (V), one per actuator.
    ///
    /// # Errors
    /// [`EngineError::NotFinite`] if a joint's angle or rate is not a number, [`EngineError::Voltages`] for too many or too few.
    fn prepare(&mut self, voltages: &[f64]) -> Result<(), EngineError>;

    /// Largest number of equal parts of a step for which [`prepare_parts`](Self::prepare_parts) wants mean voltages.
    fn parts(&self) -> usize {
        1
    }

    /// That number for the coming step, by the voltages that are `commanded` at its beginning, at its end and at the end of the next one (V, one per actuator).
    fn parts_of_step(&self, _commanded: &[Vec<f64>; 3]) -> usize {
        self.parts()
    }

    /// Takes the mean voltages (V) over equal parts of the coming step: parts × actuators values.
    ///
    /// # Errors
    /// As [`prepare`](Self::prepare).
    fn prepare_parts(&mut self, means: &[f64]) -> Result<(), EngineError> {
        self.prepare(means)
    }

    /// The joints between [`prepare`](Self::prepare) and [`advance`](Self::advance), with the torques of the coming step.
    fn joints(&mut self) -> &JointState;

    /// Positions (cm) and velocities (cm/s) of the nodes, N·m + 2 times x, y, z: the left end, each joint, the right end. On Bullet as the
    /// reference records them, see [`Recording::velocities`](crate::recording::Recording::velocities).
    ///
    /// # Errors
    /// [`EngineError::NotFinite`] if the base's position is not finite, [`EngineError::Length`] for slices of another length.
    fn nodes(&mut self, positions: &mut [f64], velocities: &mut [f64]) -> Result<(), EngineError>;

    /// Replaces the velocities that [`nodes`](Self::nodes) gave, in the reference's definition, by those of the nodes themselves (cm/s). Between
    /// [`prepare`](Self::prepare) and [`advance`](Self::advance).
    ///
    /// # Errors
    /// Whatever the engine's library reports.
    fn correct_velocities(&mut self, _velocities: &mut [f64]) -> Result<(), EngineError> {
        Ok(())
    }

    /// x and z of the nodes (cm), N·m + 2 pairs, at a small fraction of a step's cost.
    ///
    /// # Errors
    /// As [`nodes`](Self::nodes).
    fn places(&mut self, nodes: &mut [[f64; 2]]) -> Result<(), EngineError>;

    /// Time (s) until the first corner that comes down faster than `least` (cm/s) lands, at constant velocities; infinite if none does.
    fn landing(&mut self, _least: f64) -> f64 {
        f64::INFINITY
    }

    /// Voltages on the joints (V) since [`prepare`](Self::prepare).
    fn motor_voltages(&self) -> &[f64];

    /// Pose and velocity of the base in the plane of motion.
    ///
    /// # Errors
    /// Whatever the engine's library reports.
    fn base(&mut self) -> Result<PlanarBase, EngineError>;

    /// Reads the forces of the floor into `contacts`, which is cleared first.
    ///
    /// # Errors
    /// Whatever the engine's library reports.
    fn contacts(&mut self, contacts: &mut Vec<Contact>) -> Result<(), EngineError>;

    /// Puts a `robot` that has not been stepped, as it was built, at rest with these joint angles (rad): level at its left end, and so high that its lowest
    /// point touches the floor.
    ///
    /// # Errors
    /// [`EngineError::Length`] for another number of angles; whatever the engine's library reports.
    fn set_joint_angles(&mut self, robot: &Robot, angles: &[f64]) -> Result<(), EngineError>;

    /// Applies the torques and steps by the engine's time step.
    ///
    /// # Errors
    /// Whatever the engine's library reports.
    fn advance(&mut self) -> Result<(), EngineError>;

    /// The complete state, as numbers for storing.
    ///
    /// # Errors
    /// Whatever the engine's library reports.
    fn save(&self) -> Result<Vec<f64>, EngineError>;

    /// Goes on from a state that an engine of the same robot saved before step `step`.
    ///
    /// # Errors
    /// If the numbers are not a state of this robot; nothing is changed then.
    fn load(&mut self, step: u64, state: &[f64]) -> Result<(), EngineError>;

    /// Sets the length of the coming steps (s). With `ahead` they are not cut where corners land, and contact looks `ahead` (s) beyond the step's end. Comes
    /// before [`prepare`](Self::prepare).
    ///
    /// # Errors
    /// [`EngineError::FixedStep`] of an engine with a fixed step, [`EngineError::TimeStep`] for a step that is not positive.
    fn set_time_step(&mut self, _time_step: f64, _ahead: Option<f64>) -> Result<(), EngineError> {
        Err(EngineError::FixedStep)
    }

    /// Sets the number of steps taken.
    fn set_step(&mut self, _step: u64) {}

    /// Appends to `into` what [`rewind`](Self::rewind) needs to take the coming steps again, with voltages prepared anew.
    ///
    /// # Errors
    /// Whatever the engine's library reports.
    fn checkpoint(&self, into: &mut Vec<f64>) -> Result<(), EngineError> {
        into.extend(self.save()?);
        Ok(())
    }

    /// Goes back to a [`checkpoint`](Self::checkpoint) of this engine.
    ///
    /// # Errors
    /// Whatever the engine's library reports.
    fn rewind(&mut self, checkpoint: &[f64]) -> Result<(), EngineError> {
        self.load(self.step(), checkpoint)
    }

    /// True if drive, springs and dampers act at the middle of a step; otherwise they act as in the reference, at its start with the voltages of the step before.
    fn midpoint(&self) -> bool {
        false
    }

    /// Exact energies for the energy audit; `None` of an explicit engine.
    fn energy_terms(&self) -> Option<EnergyTerms> {
        None
    }

    /// Number of actuators.
    fn actuators(&self) -> usize;

    /// Number of steps taken.
    fn step(&self) -> u64;

    /// Largest elastic curvature of a joint so far (1/cm), of an explicit engine whose joints harden with it; otherwise 0.
    fn hardening_curvature(&self) -> f64 {
        0.0
    }

    /// When and how often the engine limited a velocity; `None` if never.
    fn clamp_hits(&self) -> Option<ClampHits>;
}
