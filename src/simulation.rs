//! A robot that a program steps: build, drive, step, read.

use std::borrow::Cow;

use thiserror::Error;

use crate::drive::{Drive, DriveError};
pub use crate::engine::FrictionModel;
use crate::engine::{Contact, Engine, EngineError, JointState};
use crate::experiment::{Config, Experiment, MAX_STEPS, SavedState, Supply};
pub use crate::experiment::{EngineKind, Start};
use crate::model::Robot;

/// How a robot is simulated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// What steps the robot.
    pub engine: EngineKind,
    /// Time step (s).
    pub time_step: f64,
    /// The pose at the beginning; only flat on Bullet.
    pub start: Start,
    /// Law of friction of the planar engine.
    pub friction: FrictionModel,
    /// Numerical damping of the planar engine (1/s), where it is not the engine's own.
    pub numerical_damping: Option<f64>,
}

impl Default for Options {
    /// The planar engine at steps of 1e-4 s, from a flat start, with Coulomb's friction.
    fn default() -> Self {
        Self {
            engine: EngineKind::Planar,
            time_step: 1e-4,
            start: Start::Flat,
            friction: FrictionModel::Coulomb,
            numerical_damping: None,
        }
    }
}

/// A simulation that cannot be built, or that went wrong.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// The engine refused a robot, a step, voltages or a state, or the simulation went wrong.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The drive does not fit the robot.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// Options that do not go with each other.
    #[error("{0}")]
    Options(&'static str),
    /// A voltage that is not finite, or more than the material bears.
    #[error("voltage {} {message}", .actuator + 1)]
    Voltage {
        /// The actuator, from 0.
        actuator: usize,
        /// What is wrong.
        message: String,
    },
    /// A time that cannot be run to: in the past, or not a number of steps.
    #[error("cannot run until {until} s from {time} s on")]
    Time {
        /// The time asked for (s).
        until: f64,
        /// The simulation's (s).
        time: f64,
    },
    /// A saved state that is not one of this robot.
    #[error("{0}")]
    State(String),
}

/// Position and velocity of a node: the left end, a joint, or the right end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// x and z (cm).
    pub position: [f64; 2],
    /// Along x and z (cm/s).
    pub velocity: [f64; 2],
}

/// A robot with its drive, between two time steps.
///
/// The same robot, drive, engine and time step give the bits of [`experiment::run`](crate::experiment::run). On Bullet an experiment file delays a step of
/// voltage to the third time step at least, as the reference does; [`Waveform::Step`](crate::drive::Waveform::Step) is taken as it is.
///
/// # Examples
/// ```
/// use sfers::drive::Drive;
/// use sfers::model::Robot;
/// use sfers::simulation::{Options, Simulation};
///
/// let robot = Robot::cantilever().with_motors_per_actuator(5).with_damping_eta(0.2);
/// let mut simulation = Simulation::new(robot, Drive::dc([-1000.0]), Options::default())?;
/// simulation.run_until(0.5)?;
/// let tip = simulation.nodes()?[6];
/// assert!((10.0 * tip.position[1] + 20.0).abs() < 3.0, "{} mm", 10.0 * tip.position[1]);
///
/// // A closed loop: the voltage follows from the state, step by step.
/// while simulation.time() < 0.6 {
///     let rate = simulation.joints()?.rates[0];
///     simulation.set_voltages(&[(-100.0 * rate).clamp(-1500.0, 1500.0)])?;
///     simulation.step()?;
/// }
/// # Ok::<(), sfers::simulation::SimulationError>(())
/// ```
pub struct Simulation {
    experiment: Experiment,
    engine: Box<dyn Engine>,
    supply: Supply<'static>,
    /// Voltages that replace the drive's (V), if `overridden`.
    voltages: Vec<f64>,
    overridden: bool,
    /// True if the engine has taken the voltages of the coming step.
    prepared: bool,
    /// The engine before it took them, where effects remember voltages.
    unprepared: Option<Vec<f64>>,
    nodes: Vec<Node>,
    /// Positions and velocities of the nodes, x, y and z each.
    coordinates: [Vec<f64>; 2],
    contacts: Vec<Contact>,
}

impl Simulation {
    /// A robot at its start.
    ///
    /// # Errors
    /// [`SimulationError::Engine`] for a robot or time step out of range, [`SimulationError::Drive`] for a drive that does not fit the robot,
    /// [`SimulationError::Options`].
    pub fn new(robot: Robot, drive: Drive, options: Options) -> Result<Self, SimulationError> {
        let Options { engine, time_step, start, friction, numerical_damping } = options;
        if engine == EngineKind::Bullet {
            for (given, message) in [
                (start == Start::Settled, "a settled start needs the planar engine"),
                (friction == FrictionModel::Convex, "convex friction needs the planar engine"),
                (numerical_damping.is_some(), "numerical damping belongs to the planar engine"),
            ] {
                if given {
                    return Err(SimulationError::Options(message));
                }
            }
        }
        if numerical_damping.is_some_and(|damping| !(damping.is_finite() && damping >= 0.0)) {
            return Err(SimulationError::Options("numerical damping must be zero or more"));
        }
        Self::of(Experiment {
            robot,
            drive,
            time_step,
            accuracy: None,
            steps: 1,
            record_every: 1,
            record_from: 0,
            engine,
            start,
            friction,
            numerical_damping,
            velocity_limit: None,
            joint_angles: Vec::new(),
            effects: Vec::new(),
            config: Config::default(),
        })
    }

    /// The robot of an experiment, with its effects. Its records do not matter, nor does its length, except that `creep` has relaxation times up to it.
    ///
    /// # Errors
    /// As [`new`](Self::new); [`SimulationError::Options`] for an experiment whose steps adapt.
    pub fn of(experiment: Experiment) -> Result<Self, SimulationError> {
        if experiment.accuracy.is_some() {
            return Err(SimulationError::Options("steps that adapt need experiment::run; give the time step in seconds"));
        }
        let time_step = experiment.time_step;
        if !(time_step.is_finite() && time_step > 0.0) {
            return Err(EngineError::TimeStep { time_step }.into());
        }
        experiment.robot.check().map_err(EngineError::from)?;
        experiment.drive.check(&experiment.robot).map_err(|error| match error {
            DriveError::Count { given, needed } => EngineError::Voltages { given, needed }.into(),
            error => SimulationError::Drive(error),
        })?;
        let engine = experiment.engine()?;
        let supply = Supply::of(Cow::Owned(experiment.drive.clone()), engine.as_ref(), 0.0);
        let nodes = experiment.robot.joints() + 2;
        Ok(Self {
            engine,
            supply,
            voltages: Vec::new(),
            overridden: false,
            prepared: false,
            unprepared: None,
            nodes: Vec::with_capacity(nodes),
            coordinates: [(); 2].map(|()| vec![0.0; 3 * nodes]),
            contacts: Vec::new(),
            experiment,
        })
    }

    /// The robot, with effects in it.
    pub fn robot(&self) -> &Robot {
        &self.experiment.robot
    }

    /// Time (s): the number of steps times the time step.
    pub fn time(&self) -> f64 {
        self.engine.step() as f64 * self.experiment.time_step
    }

    /// Number of steps taken.
    pub fn steps(&self) -> u64 {
        self.engine.step()
    }

    /// Takes one time step.
    ///
    /// # Errors
    /// [`SimulationError::Engine`] if the simulation goes wrong.
    pub fn step(&mut self) -> Result<(), SimulationError> {
        self.prepare()?;
        (self.prepared, self.unprepared) = (false, None);
        Ok(self.engine.advance()?)
    }

    /// Steps to the multiple of the time step that is nearest to `time_s` (s).
    ///
    /// # Errors
    /// [`SimulationError::Time`] if that is in the past, not finite or beyond 10¹⁵ steps; [`SimulationError::Engine`].
    pub fn run_until(&mut self, time_s: f64) -> Result<(), SimulationError> {
        let last = (time_s / self.experiment.time_step).round();
        if !(self.engine.step() as f64..=MAX_STEPS).contains(&last) {
            return Err(SimulationError::Time { until: time_s, time: self.time() });
        }
        while self.engine.step() < last as u64 {
            self.step()?;
        }
        Ok(())
    }

    /// Gives the actuators these voltages (V) in all coming steps, in place of the drive's and without its gain and delay. Effects act on
    /// them.
    ///
    /// # Errors
    /// [`EngineError::Voltages`] if there is not one per actuator; [`SimulationError::Voltage`] for one that is not finite, or more than the
    /// material bears. The voltages stay as they were then.
    pub fn set_voltages(&mut self, voltages: &[f64]) -> Result<(), SimulationError> {
        let (given, needed) = (voltages.len(), self.experiment.robot.actuators);
        if given != needed {
            return Err(EngineError::Voltages { given, needed }.into());
        }
        for (actuator, &voltage) in voltages.iter().enumerate() {
            let wrong = |message| SimulationError::Voltage { actuator, message };
            self.experiment.robot.check_voltage(voltage, 1.0).map_err(wrong)?;
        }
        self.unprepare()?;
        self.voltages.clear();
        self.voltages.extend_from_slice(voltages);
        self.overridden = true;
        Ok(())
    }

    /// Gives the actuators the drive's voltages again.
    ///
    /// # Errors
    /// Whatever the engine reports.
    pub fn follow_drive(&mut self) -> Result<(), SimulationError> {
        if self.overridden {
            self.unprepare()?;
            self.overridden = false;
            self.supply.restart(self.time());
        }
        Ok(())
    }

    /// Angles (rad) and rates (rad/s) of the joints, one per joint from the left, with torques (dyn·cm) and voltages (V) of the coming step.
    ///
    /// # Errors
    /// [`EngineError::NotFinite`] if one is no longer a number.
    pub fn joints(&mut self) -> Result<&JointState, SimulationError> {
        self.prepare_to_read()?;
        Ok(self.engine.joints())
    }

    /// The N·m + 2 nodes from left to right: the left end, the joints, the right end. On Bullet the positions are those that the reference
    /// records: the joints' lag the state by one step.
    ///
    /// # Errors
    /// [`EngineError::NotFinite`] if one is no longer at a place.
    pub fn nodes(&mut self) -> Result<&[Node], SimulationError> {
        self.prepare_to_read()?;
        let [positions, velocities] = &mut self.coordinates;
        self.engine.nodes(positions, velocities)?;
        self.engine.correct_velocities(velocities)?;
        self.nodes.clear();
        let nodes = positions.chunks_exact(3).zip(velocities.chunks_exact(3));
        self.nodes.extend(nodes.map(|(p, v)| Node { position: [p[0], p[2]], velocity: [v[0], v[2]] }));
        Ok(&self.nodes)
    }

    /// Forces of the floor on the robot during the last step.
    ///
    /// # Errors
    /// Whatever the engine reports.
    pub fn contacts(&mut self) -> Result<&[Contact], SimulationError> {
        self.engine.contacts(&mut self.contacts)?;
        Ok(&self.contacts)
    }

    /// The state, for another simulation of the same robot. Voltages that were set are not part of it.
    ///
    /// # Errors
    /// Whatever the engine reports.
    pub fn save(&mut self) -> Result<SavedState, SimulationError> {
        if self.unprepared.is_some() {
            self.unprepare()?;
        }
        Ok(SavedState::of(&self.experiment, self.engine.as_ref())?)
    }

    /// Goes on from a state of the same robot, engine and time step; drive and set voltages stay those of this simulation.
    ///
    /// # Errors
    /// [`SimulationError::State`] says in what the states' robots differ; nothing is changed then.
    pub fn restore(&mut self, state: &SavedState) -> Result<(), SimulationError> {
        state.check(&self.experiment).map_err(SimulationError::State)?;
        state.load_into(self.engine.as_mut())?;
        (self.prepared, self.unprepared) = (false, None);
        self.supply.restart(self.time());
        Ok(())
    }

    /// Gives the engine the voltages of the coming step.
    fn prepare(&mut self) -> Result<(), EngineError> {
        if self.prepared {
            return Ok(());
        }
        if self.overridden {
            self.engine.prepare(&self.voltages)?;
        } else {
            let step = self.engine.step();
            self.supply.prepare(self.engine.as_mut(), step, self.experiment.time_step)?;
        }
        self.prepared = true;
        Ok(())
    }

    /// Prepares such that it can be undone.
    fn prepare_to_read(&mut self) -> Result<(), EngineError> {
        if !self.prepared && !self.experiment.effects.is_empty() {
            let mut checkpoint = Vec::new();
            self.engine.checkpoint(&mut checkpoint)?;
            self.unprepared = Some(checkpoint);
        }
        self.prepare()
    }

    /// Undoes [`prepare_to_read`](Self::prepare_to_read).
    fn unprepare(&mut self) -> Result<(), EngineError> {
        if !self.prepared {
            return Ok(());
        }
        if let Some(checkpoint) = self.unprepared.take() {
            self.engine.rewind(&checkpoint)?;
        }
        self.prepared = false;
        if !self.overridden {
            self.supply.restart(self.time());
        }
        Ok(())
    }
}
