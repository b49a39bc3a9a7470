//! The loop over steps.

use super::Experiment;
use crate::engine::{Books, ClampHits, EnergyBalance, Engine, EngineError};
use crate::recording::Recording;

/// Steps between two calls of the observer: often enough for a progress bar, too rare to cost anything.
const OBSERVE_EVERY: u64 = 256;

/// What the observer of a run decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// Go on.
    Continue,
    /// Stop and keep what was recorded.
    Stop,
}

/// A finished or interrupted run.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// What was recorded.
    pub recording: Recording,
    /// Whether the observer stopped the run before its end.
    pub interrupted: bool,
    /// Whether the engine had to limit velocities.
    pub clamp_hits: Option<ClampHits>,
    /// Where energy came from and where it went.
    pub energy: EnergyBalance,
}

impl Run {
    /// What went wrong without stopping the run; measures of such a run would be those of another robot.
    pub fn trouble(&self, experiment: &Experiment) -> Vec<String> {
        let clamp = self.clamp_hits.map(|hits| {
            format!(
                "Bullet limited a velocity to {} (cm/s or rad/s) after {} steps, first at step {}, t = {:.6} s: from there on the \
                 motion is not that of the model; try a smaller time step",
                hits.limit,
                hits.steps,
                hits.first_step,
                hits.first_step as f64 * experiment.time_step
            )
        });
        let energy = self.energy.fault.map(|fault| {
            let link = fault.link.map_or_else(String::new, |link| format!(", on link {link} (0: left end)"));
            format!(
                "energy appeared that nothing supplied, {:.0} % of the largest mechanical energy, first at t = {:.6} s{link}: the \
                 contact solver or a too long time step made it; try a smaller time step or a smoother drive",
                100.0 * self.energy.error(),
                fault.time_s
            )
        });
        clamp.into_iter().chain(energy).collect()
    }
}

/// Runs an experiment on an engine of its robot, from the engine's step on. `observe` is called every 256 steps with the number of steps done.
///
/// One step, in the reference's order: the voltages are those of the *previous* step's time (0 for the first two steps); the time
/// is step · dt; joints are read and torques computed; the state before the step is recorded if its turn has come; the torques are
/// applied and the world steps. An engine that works at the middle of a step gets the step's mean voltages instead. Nothing is allocated inside the loop: the recording has its final size from the start.
///
/// # Errors
/// [`EngineError`] if the simulation goes wrong; what was recorded until then is lost.
pub fn run(
    experiment: &Experiment,
    engine: &mut dyn Engine,
    mut observe: impl FnMut(u64) -> Control,
) -> Result<Run, EngineError> {
    let mut recorder = Recorder::new(experiment);
    let mut books = Books::new(&experiment.robot, experiment.time_step);
    let mut voltages = vec![0.0; experiment.robot.actuators];
    let midpoint = engine.midpoint();
    let mut interrupted = false;
    let mut done = engine.step();
    let mut time = done.saturating_sub(1) as f64 * experiment.time_step;
    // Voltages at the beginning of the coming step.
    let mut start = voltages.clone();
    experiment.drive.voltages(done as f64 * experiment.time_step, &mut start);
    while done < experiment.steps {
        if done.is_multiple_of(OBSERVE_EVERY) && observe(done) == Control::Stop {
            interrupted = true;
            break;
        }
        let before = time;
        time = done as f64 * experiment.time_step;
        if midpoint {
            let end = (done + 1) as f64 * experiment.time_step;
            experiment.drive.mean(time, end, &mut start, &mut voltages);
        } else {
            experiment.drive.voltages(before, &mut voltages);
        }
        engine.prepare(&voltages)?;
        books.take(engine)?;
        if experiment.records(done) {
            recorder.record(time, engine)?;
        }
        engine.advance()?;
        done += 1;
    }
    let mut recording = recorder.recording;
    recording.meta = experiment.meta(done, String::new());
    Ok(Run { recording, interrupted, clamp_hits: engine.clamp_hits(), energy: books.balance() })
}

/// A recording that grows in memory set aside for it.
struct Recorder {
    recording: Recording,
    nodes: usize,
}

impl Recorder {
    fn new(experiment: &Experiment) -> Self {
        // The last step may fall beside the interval, and so does the first.
        let records = (experiment.steps / experiment.record_every + 2) as usize;
        let joints = experiment.robot.joints();
        let nodes = joints + 2;
        let of = |width: usize| Vec::with_capacity(records * width);
        let recording = Recording {
            meta: experiment.meta(experiment.steps, String::new()),
            time: of(1),
            angles: of(joints),
            rates: of(joints),
            torques: of(joints),
            motor_voltages: of(joints),
            positions: of(3 * nodes),
            velocities: of(3 * nodes),
        };
        Self { recording, nodes }
    }

    fn record(&mut self, time: f64, engine: &mut dyn Engine) -> Result<(), EngineError> {
        let r = &mut self.recording;
        let state = engine.joints();
        r.time.push(time);
        r.angles.extend_from_slice(&state.angles);
        r.rates.extend_from_slice(&state.rates);
        r.torques.extend_from_slice(&state.torques);
        r.motor_voltages.extend_from_slice(&state.motor_voltages);
        let at = r.positions.len();
        r.positions.resize(at + 3 * self.nodes, 0.0);
        r.velocities.resize(at + 3 * self.nodes, 0.0);
        engine.nodes(&mut r.positions[at..], &mut r.velocities[at..])
    }
}
