//! An experiment: a robot, what drives it, and how long it is simulated.

mod adaptive;
mod auto;
mod config;
pub mod ensemble;
pub mod presets;
mod range;
mod resolve;
mod run;
mod spec;
mod state;
mod step_choice;

pub(crate) use config::line_of;
pub use config::{
    Config, ConfigError, DriveConfig, EffectConfig, EffectValue, FrictionConfig, MassConfig, MaterialConfig, PhaseConfig,
    RobotConfig, Setting, SimulationConfig, Source, StepConfig,
};
pub use ensemble::{EnsembleConfig, PerturbationConfig, Spread};
pub use range::Bending;
pub(crate) use range::{step_too_long, unstable};
#[cfg(test)]
pub(crate) use resolve::DEFAULT_STEP_ERROR;
pub use resolve::{experiment, with_bodies};
pub use run::{Control, Run};
pub(crate) use run::{Supply, hermite, hermite_at};
pub use state::SavedState;
pub use step_choice::{Accuracy, StepChoice, StepTrial};

use crate::drive::{Drive, DriveError, Waveform};
use crate::effects::{Applied, SignalChain};
use crate::engine::{AffectedEngine, Engine, EngineError, FrictionModel, PlanarEngine};
use crate::model::{Mount, Robot};
use crate::recording::{GroundMeta, Meta, definitions};

/// Most steps of a run: up to here rounding of a time is an eighth of a step at most.
pub(crate) const MAX_STEPS: f64 = 1e15;

/// A checked experiment in CGS units.
///
/// # Examples
/// ```
/// use sfers::experiment::{self, Control, Source};
/// let mut source = Source::from_text("preset", experiment::presets::find("cantilever-dc").unwrap().text);
/// source.set("simulation.duration_s=0.001")?;
/// let experiment = experiment::experiment(&source)?;
/// let run = experiment::run(&experiment, experiment.engine()?.as_mut(), |_| Control::Continue)?;
/// assert_eq!(run.recording.joints(), 3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// The robot.
    pub robot: Robot,
    /// What drives it.
    pub drive: Drive,
    /// Time step (s).
    pub time_step: f64,
    /// What steps that adapt are chosen for, if they do; `time_step` is that of the records then.
    pub accuracy: Option<Accuracy>,
    /// Number of steps.
    pub steps: u64,
    /// Number of steps from one record to the next; the first and last step are recorded as well.
    pub record_every: u64,
    /// The step before which the first regular record is taken.
    pub record_from: u64,
    /// What steps the robot.
    pub engine: EngineKind,
    /// Where the robot starts from.
    pub start: Start,
    /// How the planar engine treats sliding.
    pub friction: FrictionModel,
    /// Numerical damping of the planar engine (1/s), where it is not the engine's own.
    pub numerical_damping: Option<f64>,
    /// Bullet's limit on velocities (cm/s of the base, rad/s of base and joints), where it is not the reference's.
    pub velocity_limit: Option<f64>,
    /// Angles of the joints at the beginning (rad); empty for the flat robot.
    pub joint_angles: Vec<f64>,
    /// Extensions of the model; those that act on robot and drive are in them already.
    pub effects: Vec<Applied>,
    /// The keys as they were given.
    pub config: Config,
}

/// The engines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EngineKind {
    /// Bullet, bit for bit as the reference.
    Bullet,
    /// The fast one in the plane.
    Planar,
}

/// The pose at the beginning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// Flat and at rest, as in the reference.
    Flat,
    /// At rest in equilibrium with gravity, the floor and the first voltages.
    Settled,
}

impl Experiment {
    /// Builds the experiment's engine.
    ///
    /// # Errors
    /// [`EngineError`] if the robot cannot be built; [`EngineError::Voltages`] for a drive of another number of actuators; [`EngineError::NoBullet`] for Bullet in a build without it.
    pub fn engine(&self) -> Result<Box<dyn Engine>, EngineError> {
        let mut chain = SignalChain::new(&self.effects, self.robot.actuators, self.steps as f64 * self.time_step);
        if let Err(DriveError::Count { given, needed }) = self.drive.check(&self.robot) {
            return Err(EngineError::Voltages { given, needed });
        }
        let mut voltages = vec![0.0; self.robot.actuators];
        self.drive.voltages(0.0, &mut voltages);
        chain.settle(&mut voltages);
        let mut engine: Box<dyn Engine> = match self.engine {
            #[cfg(not(feature = "bullet"))]
            EngineKind::Bullet => return Err(EngineError::NoBullet),
            #[cfg(feature = "bullet")]
            EngineKind::Bullet => {
                let mut engine = crate::engine::BulletEngine::new(&self.robot, self.time_step)?;
                if let Some(limit) = self.velocity_limit {
                    engine.set_velocity_limit(limit)?;
                }
                Box::new(engine)
            }
            EngineKind::Planar => {
                let mut engine = match self.numerical_damping {
                    Some(damping) => PlanarEngine::with_numerical_damping(&self.robot, self.time_step, damping)?,
                    None => PlanarEngine::new(&self.robot, self.time_step)?,
                };
                engine.set_friction_model(self.friction);
                if self.start == Start::Settled {
                    engine.settle(&voltages)?;
                }
                Box::new(engine)
            }
        };
        if !self.joint_angles.is_empty() {
            engine.set_joint_angles(&self.robot, &self.joint_angles)?;
        }
        Ok(if chain.is_empty() { engine } else { Box::new(AffectedEngine::new(engine, chain, self.time_step)) })
    }

    /// Leaves out records that `measures` do not come from, where nothing else is wanted of a run.
    pub(crate) fn record_only_what_measures_need(&mut self, measures: &[impl AsRef<str>]) {
        let path_counts = self.accuracy.as_ref().is_some_and(|accuracy| accuracy.measure.is_none());
        let of_records = |name: &str| name == definitions::OF_RECORDS;
        let needed = self.accuracy.iter().filter_map(|accuracy| accuracy.measure.as_deref());
        if !path_counts && !measures.iter().map(AsRef::as_ref).chain(needed).any(of_records) {
            self.record_every = self.steps.max(1);
        }
    }

    /// Whether the state before step `step` is recorded: a multiple of the interval after the first regular record, or the first or last step. By
    /// default `(step + 1)` is a multiple of the interval, as in the reference.
    pub fn records(&self, step: u64) -> bool {
        let regular = step.checked_sub(self.record_from).is_some_and(|past| past.is_multiple_of(self.record_every));
        regular || step == 0 || step == self.steps - 1
    }

    /// The numbers that go with the recording of a run of `steps` steps, saved at `date_time`.
    pub fn meta(&self, steps: u64, date_time: String) -> Meta {
        let frequency = match &self.drive.waveform {
            Waveform::Sine { frequency, .. } => *frequency,
            _ => 1.0,
        };
        let period = match &self.drive.waveform {
            Waveform::Gait { parameter, .. } => *parameter,
            _ => self.drive.period().unwrap_or(0.0),
        };
        let friction = &self.robot.friction;
        Meta {
            time_step: self.time_step,
            steps,
            record_every: self.record_every,
            actuators: self.robot.actuators,
            motors_per_actuator: self.robot.motors_per_actuator,
            actuator_length: self.robot.material.actuator_length,
            driven_frequency: frequency,
            damping_eta: self.robot.damping.eta(),
            ground: (self.robot.mount == Mount::Ground).then_some(GroundMeta {
                friction_low: friction.low,
                friction_high: friction.high,
                period,
                date_time,
            }),
        }
    }
}

/// Runs an experiment on an engine of its robot, from the engine's step on. `observe` is called every 256 steps, more often for more than 64 joints, with the
/// number of steps done.
///
/// One step, in the reference's order: the voltages are those of the *previous* step's time (0 for the first two steps); the time is step · dt; joints are read
/// and torques computed; the state before the step is recorded if it is due; the torques are applied and the world steps. An engine whose forces act at the
/// middle of a step gets the step's mean voltages instead, or those of several parts of the step according to [`Engine::parts`].
///
/// With an [`accuracy`](Experiment::accuracy) the steps adapt, the experiment's time step is the grid of its records, and `observe` sees several runs, with
/// ever tighter tolerances.
///
/// # Errors
/// [`EngineError`] if the simulation fails; its records are lost.
pub fn run(experiment: &Experiment, engine: &mut dyn Engine, observe: impl FnMut(u64) -> Control) -> Result<Run, EngineError> {
    match &experiment.accuracy {
        Some(accuracy) => auto::run(experiment, accuracy, engine, observe),
        None => run::run(experiment, engine, observe),
    }
}
