//! Stepping a robot in time.
//!
//! An [`Engine`] knows one robot. Each step begins with [`prepare`](Engine::prepare), which takes the voltages and looks whether
//! the joints are still numbers, and ends with [`advance`](Engine::advance); between the two the state before the step can be
//! observed. The loop over steps lives in [`experiment::run`](crate::experiment::run).

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

use crate::model::ModelError;

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
    /// An engine whose steps are all of one length.
    #[error("this engine's steps are all of one length; adaptive steps need engine = \"planar\"")]
    FixedStep,
    /// A time step that is no step.
    #[error("the time step is {time_step} s, but must be a positive number")]
    TimeStep {
        /// The step (s).
        time_step: f64,
    },
    /// Not one voltage per actuator.
    #[error("{given} voltages for a robot of {needed} actuators")]
    Voltages {
        /// How many there are.
        given: usize,
        /// How many there must be.
        needed: usize,
    },
    /// A result that finer steps still change.
    #[error("{0}")]
    NotResolved(String),
    /// A robot that comes to rest nowhere.
    #[error("there is no equilibrium to start from: {reason}")]
    NoEquilibrium {
        /// Why.
        reason: String,
    },
    /// A saved state that is not one of this robot.
    #[error("the state does not fit this robot")]
    State,
    /// A coordinate is no longer a number.
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

    /// The same at a step and time (s) that are counted otherwise.
    pub(crate) fn at(mut self, (at_step, at_time): (u64, f64)) -> Self {
        if let Self::NotConverged { step, time, .. } | Self::NotFinite { step, time, .. } = &mut self {
            (*step, *time) = (at_step, at_time);
        }
        self
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

/// How often Bullet's limit on velocities was reached.
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

/// A robot that can be stepped.
pub trait Engine {
    /// Takes the voltages of the coming step (V), one per actuator.
    ///
    /// # Errors
    /// [`EngineError::NotFinite`] if a joint's angle or rate is not a number, [`EngineError::Voltages`] for too many or too few.
    fn prepare(&mut self, voltages: &[f64]) -> Result<(), EngineError>;

    /// Into how many equal parts of a step the voltages are better given, where they may jump within it: see [`prepare_parts`](Self::prepare_parts).
    fn parts(&self) -> usize {
        1
    }

    /// Takes the mean voltages (V) of [`parts`](Self::parts) equal parts of the coming step, one per actuator, part after part.
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
    /// [`EngineError::NotFinite`] if the base's position is not a number.
    fn nodes(&mut self, positions: &mut [f64], velocities: &mut [f64]) -> Result<(), EngineError>;

    /// Turns the velocities that [`nodes`](Self::nodes) gave into those of the nodes themselves (cm/s) between
    /// [`prepare`](Self::prepare) and [`advance`](Self::advance).
    ///
    /// # Errors
    /// Whatever the engine's library reports.
    fn correct_velocities(&mut self, _velocities: &mut [f64]) -> Result<(), EngineError> {
        Ok(())
    }

    /// Places of the nodes alone, x and z (cm), at little cost: for what is followed at every step.
    ///
    /// # Errors
    /// As [`nodes`](Self::nodes).
    fn places(&mut self, nodes: &mut [[f64; 2]]) -> Result<(), EngineError>;

    /// Time (s) in which the first corner that comes down faster than `least` (cm/s) lands, if all go on as they move now; infinite where none does.
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

    /// Applies the torques and steps by the engine's time step.
    ///
    /// # Errors
    /// Whatever the engine's library reports.
    fn advance(&mut self) -> Result<(), EngineError>;

    /// Energy that the engine's time stepping is known to have taken since the engine was built (erg).
    fn numerical_loss(&self) -> f64 {
        0.0
    }

    /// Everything that a later step depends on, as numbers for storing.
    ///
    /// # Errors
    /// Whatever the engine's library reports.
    fn save(&self) -> Result<Vec<f64>, EngineError>;

    /// Goes on from a state that an engine of the same robot saved before step `step`.
    ///
    /// # Errors
    /// If the numbers are not a state of this robot; nothing is changed then.
    fn load(&mut self, step: u64, state: &[f64]) -> Result<(), EngineError>;

    /// Makes the coming steps `time_step` (s) long. With `ahead` they are not cut where corners land, and no corner may come so low that it would be
    /// under the floor `ahead` (s) after the step.
    /// What is prepared is prepared for the old step.
    ///
    /// # Errors
    /// [`EngineError::FixedStep`] of an engine whose steps are all of one length.
    fn set_time_step(&mut self, _time_step: f64, _ahead: Option<f64>) -> Result<(), EngineError> {
        Err(EngineError::FixedStep)
    }

    /// Counts the coming steps on from `step`.
    fn set_step(&mut self, _step: u64) {}

    /// Adds to `into` what [`rewind`](Self::rewind) needs for taking the coming steps again, with the voltages prepared anew.
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

    /// Whether drive, springs and dampers act at the middle of a step. Otherwise they act as in the reference: at its start, with the
    /// voltages of the step before.
    fn midpoint(&self) -> bool {
        false
    }

    /// Sums over the joints and all steps so far of voltage times turn (V·rad) and of the turn's square over the step (rad²/s), of an engine
    /// that works at the middle of steps: the energy audit reads what they grow by.
    fn work_sums(&self) -> [f64; 2] {
        [0.0; 2]
    }

    /// Kinetic energy (erg), where it is more exactly known than from the motion of base and joints.
    fn kinetic_energy(&self) -> Option<f64> {
        None
    }

    /// The same of gravitational energy, from any level.
    fn gravitational_energy(&self) -> Option<f64> {
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

    /// Whether, when and how often the engine limited a velocity.
    fn clamp_hits(&self) -> Option<ClampHits>;
}
