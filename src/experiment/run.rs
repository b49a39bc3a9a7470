//! The loop over steps.

use std::borrow::Cow;

use super::Experiment;
use super::range::{self, Bending, CLEARLY};
use super::step_choice::StepChoice;
use crate::analytic;
use crate::drive::{Drive, Means, Waveform};
use crate::effects::View;
use crate::engine::{ClampHits, EnergyAudit, EnergyBalance, Engine, EngineError};
use crate::model::{Extensions, Robot};
use crate::recording::Recording;
use crate::recording::accumulator::{MeasureAccumulator, SamplingPlan};
use crate::recording::measures::{Measures, recorded_jump_height};

/// Steps between two calls of the observer: often enough for a progress bar, too rare to cost anything.
const OBSERVE_EVERY: u64 = 256;
/// The same in steps times joints, so that a step of a long chain is not waited for too often.
const OBSERVE_EVERY_JOINTS: u64 = 1 << 14;
/// Samples of measures between two readings of the joint angles for [`Bending`], of an engine that computes them on demand: ten readings in a
/// period miss at most 5 % of an amplitude. On Bullet, which reads them anyway, every step counts.
const BEND_EVERY_SAMPLES: u64 = 10;

/// Samples that measures are taken of in a period of the drive, and in one of an actuator's first mode.
const SAMPLES: f64 = 100.0;

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
    /// Measures of the run itself, whatever is recorded, seen as the effects make them seen. Of an interrupted run those are absent that belong to its end. If the run has
    /// [`trouble`](Self::trouble) they are those of another robot.
    pub measures: Measures,
    /// Whether the observer stopped the run before its end.
    pub interrupted: bool,
    /// Whether the engine had to limit velocities.
    pub clamp_hits: Option<ClampHits>,
    /// The largest stable time step (s), if the engine is explicit and its step was longer.
    pub unstable: Option<f64>,
    /// The most that a joint was bent.
    pub bending: Bending,
    /// Where energy came from and where it went.
    pub energy: EnergyBalance,
    /// Whether the audit of energy were kept: they know the plain model only.
    pub audited: bool,
    /// How the steps were chosen, if they adapted.
    pub step_choice: Option<StepChoice>,
}

impl Run {
    /// What went wrong without stopping the run; measures of such a run would be those of another robot.
    pub fn trouble(&self, experiment: &Experiment) -> Vec<String> {
        let aliased = range::aliased(experiment);
        let unstable = self.unstable.map(|stable| range::step_too_long(experiment.time_step, stable));
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
        let bending = self.bending.beyond(&experiment.robot, CLEARLY);
        aliased.into_iter().chain(unstable).chain(clamp).chain(bending).chain(energy).collect()
    }

    /// What is to be known of measures that are given: nothing that [`trouble`](Self::trouble) says.
    pub fn warnings(&self, experiment: &Experiment) -> Vec<String> {
        let bending = |times| self.bending.beyond(&experiment.robot, times);
        let bent = if bending(CLEARLY).is_none() { bending(1.0) } else { None };
        bent.into_iter().chain(not_applied(&experiment.robot)).collect()
    }
}

/// What is to be known of a robot whose bodies were read from a file, if effects would change them.
fn not_applied(robot: &Robot) -> Option<String> {
    robot.bodies.as_ref()?;
    let Extensions { mass_scale, friction_scale, .. } = robot.extensions;
    let what = match (mass_scale != 1.0, friction_scale != 1.0) {
        (false, false) => return None,
        (true, false) => "masses",
        (false, true) => "frictions",
        (true, true) => "masses and frictions",
    };
    Some(format!(
        "the links' {what} are those of the robot's file; effects that scale them are not applied (a file written by sfers urdf holds them already)"
    ))
}

/// [`experiment::run`](super::run) with steps of one length. Nothing is allocated inside the loop: the recording has its final size from the start.
pub(super) fn run(
    experiment: &Experiment,
    engine: &mut dyn Engine,
    mut observe: impl FnMut(u64) -> Control,
) -> Result<Run, EngineError> {
    let midpoint = engine.midpoint();
    let start = engine.step();
    let mut done = start;
    let every = sample_every(experiment);
    let last = experiment.steps.saturating_sub(1).max(start);
    let mut observation = Observation::new(experiment, start, every, last);
    let observe_every = (OBSERVE_EVERY_JOINTS / experiment.robot.joints().max(1) as u64).clamp(1, OBSERVE_EVERY);
    let mut sampled = Every::new(start, every);
    let mut bent = Every::new(start, if midpoint { BEND_EVERY_SAMPLES * every } else { 1 });
    let mut observed = Every::new(start, observe_every);
    let mut supply = Supply::new(experiment, engine, done as f64 * experiment.time_step);
    let mut interrupted = false;
    while done < experiment.steps {
        if observed.comes(done) && observe(done) == Control::Stop {
            interrupted = true;
            break;
        }
        let time = done as f64 * experiment.time_step;
        supply.prepare(engine, done, experiment.time_step)?;
        if let Some(audit) = &mut observation.audit {
            audit.take(time, engine)?;
        }
        let last = done + 1 == experiment.steps;
        let regular = sampled.comes(done) || last;
        if regular || observation.accumulator.is_close() {
            observation.sample(time, regular, engine)?;
        }
        if experiment.records(done) {
            observation.recorder.record(time, engine)?;
        }
        if bent.comes(done) || last {
            observation.bending.take(&engine.joints().angles, time);
        }
        engine.advance()?;
        done += 1;
    }
    Ok(observation.finish(engine, done, interrupted))
}

/// The voltages of an experiment, for an engine that works at the middle of steps or one that works at their start.
pub(crate) struct Supply<'a> {
    means: Means<'a>,
    voltages: Vec<f64>,
    /// True of an engine that works at the middle of steps.
    midpoint: bool,
    /// Most parts into which a step is cut for the engine, and their voltages.
    parts: usize,
    pieces: Vec<f64>,
    /// Voltages commanded at the beginning of a step, at its end and at the end of the next one.
    commanded: [Vec<f64>; 3],
}

impl<'a> Supply<'a> {
    /// From the time `start` (s) on.
    pub(super) fn new(experiment: &'a Experiment, engine: &dyn Engine, start: f64) -> Self {
        Self::of(Cow::Borrowed(&experiment.drive), engine, start)
    }

    pub(crate) fn of(drive: Cow<'a, Drive>, engine: &dyn Engine, start: f64) -> Self {
        let actuators = engine.actuators();
        // A smooth drive needs no parts.
        let parts = if matches!(drive.waveform, Waveform::Sine { .. }) { 1 } else { engine.parts() };
        Self {
            means: Means::of(drive, actuators, start),
            voltages: vec![0.0; actuators],
            midpoint: engine.midpoint(),
            parts,
            pieces: vec![0.0; parts * actuators],
            commanded: [vec![0.0; actuators], vec![0.0; actuators], vec![0.0; actuators]],
        }
    }

    /// Begins anew at the time `start` (s).
    pub(crate) fn restart(&mut self, start: f64) {
        self.means.restart(start);
    }

    /// Gives the engine the voltages of a step of `time_step` (s), which begins where the one before ended: their means over the step for an engine
    /// that works at its middle, those of the time of the step before for another, as in the reference.
    pub(crate) fn prepare(&mut self, engine: &mut dyn Engine, step: u64, time_step: f64) -> Result<(), EngineError> {
        if !self.midpoint {
            return self.prepare_at(engine, step.saturating_sub(1) as f64 * time_step);
        }
        let from = step as f64 * time_step;
        let parts = if self.parts == 1 {
            1
        } else {
            self.means.drive().ahead(step, time_step, &mut self.commanded);
            engine.parts_of_step(&self.commanded)
        };
        if parts == 1 {
            self.means.over(from, (step + 1) as f64 * time_step, &mut self.voltages);
            return engine.prepare(&self.voltages);
        }
        let at = |part: usize| from + time_step * part as f64 / parts as f64;
        let pieces = &mut self.pieces[..parts * self.voltages.len()];
        for (part, piece) in pieces.chunks_exact_mut(self.voltages.len()).enumerate() {
            self.means.over(at(part), at(part + 1), piece);
        }
        engine.prepare_parts(pieces)
    }

    /// Gives the engine the voltages of a step within which none jumps.
    pub(super) fn prepare_smooth(&mut self, engine: &mut dyn Engine, from: f64, to: f64) -> Result<(), EngineError> {
        let drive = self.means.drive();
        if self.parts == 1 {
            drive.mean_without_jump(from, to, &mut self.voltages);
            return engine.prepare(&self.voltages);
        }
        let at = |part: usize| from + (to - from) * part as f64 / self.parts as f64;
        for (part, piece) in self.pieces.chunks_exact_mut(self.voltages.len()).enumerate() {
            drive.mean_without_jump(at(part), at(part + 1), piece);
        }
        engine.prepare_parts(&self.pieces)
    }

    /// Gives the engine the voltages of the time `t` (s).
    fn prepare_at(&mut self, engine: &mut dyn Engine, t: f64) -> Result<(), EngineError> {
        self.means.drive().voltages(t, &mut self.voltages);
        engine.prepare(&self.voltages)
    }
}

/// What is kept of a run while it goes on.
pub(super) struct Observation<'a> {
    experiment: &'a Experiment,
    pub(super) recorder: Recorder,
    pub(super) audit: Option<EnergyAudit>,
    pub(super) accumulator: MeasureAccumulator,
    pub(super) bending: Bending,
    view: View,
    /// x of the left end of the flat robot (cm).
    origin: f64,
}

impl<'a> Observation<'a> {
    /// Of a run from step `start` on, whose regular samples are `every` steps apart and end with step `last`.
    pub(super) fn new(experiment: &'a Experiment, start: u64, every: u64, last: u64) -> Self {
        Self {
            recorder: Recorder::new(experiment),
            audit: experiment.effects.is_empty().then(|| EnergyAudit::new(&experiment.robot, experiment.time_step)),
            accumulator: accumulator(experiment, start, every, last),
            bending: Bending::default(),
            view: View::new(&experiment.effects),
            origin: -0.5 * experiment.robot.segments()[0].length,
            experiment,
        }
    }

    /// Shows the engine's robot at `time` (s) to the accumulator, as it is seen.
    fn sample(&mut self, time: f64, regular: bool, engine: &mut dyn Engine) -> Result<(), EngineError> {
        engine.places(self.accumulator.places())?;
        self.take_sample(time, regular, engine.motor_voltages());
        Ok(())
    }

    /// The same of the places that stand in the accumulator.
    pub(super) fn take_sample(&mut self, time: f64, regular: bool, motor_voltages: &[f64]) {
        self.accumulator.voltages(time, motor_voltages);
        self.see();
        if self.view.delay > 0.0 && self.accumulator.is_new() {
            // Before the first state the robot stood as in it.
            self.accumulator.take_standing(time);
        }
        self.accumulator.take(time + self.view.delay, regular);
    }

    /// Shows the nodes' places of `time` (s), which stand in the accumulator, as they are seen.
    fn see(&mut self) {
        if !self.view.is_plain() {
            let (view, origin) = (&self.view, self.origin);
            self.accumulator.places().iter_mut().for_each(|[x, z]| [*x, *z] = view.of([*x - origin, *z]));
        }
    }

    /// The run, which ended after `done` steps.
    pub(super) fn finish(self, engine: &dyn Engine, done: u64, interrupted: bool) -> Run {
        let Self { experiment, recorder, audit, accumulator, bending, view, origin } = self;
        let mut recording = recorder.recording;
        recording.meta = experiment.meta(done, String::new());
        see(&mut recording, &view, origin);
        let energy = audit.as_ref().map(EnergyAudit::balance);
        let mut measures = Measures { energy_error: energy.map(|energy| energy.error()), ..accumulator.measures() };
        if measures.jump_height_mm.is_some() {
            measures.recorded_jump_height_mm = Some(recorded_jump_height(&recording));
        }
        Run {
            recording,
            measures,
            interrupted,
            clamp_hits: engine.clamp_hits(),
            unstable: range::unstable(experiment, engine.hardening_curvature()),
            audited: energy.is_some(),
            bending,
            energy: energy.unwrap_or_default(),
            step_choice: None,
        }
    }
}

/// Steps at equal distances, told without a division in each step.
struct Every {
    next: u64,
    by: u64,
}

impl Every {
    fn new(first: u64, by: u64) -> Self {
        Self { next: first, by }
    }

    /// Whether `step` is one of them; asked in every step.
    fn comes(&mut self, step: u64) -> bool {
        let comes = step == self.next;
        if comes {
            self.next += self.by;
        }
        comes
    }
}

/// Number of steps from one regular sample of the measures to the next.
pub(super) fn sample_every(experiment: &Experiment) -> u64 {
    let robot = &experiment.robot;
    let first_mode = analytic::cantilever_frequency(robot) * (robot.actuators as f64).powi(2);
    let spacing = experiment.drive.period().unwrap_or(f64::INFINITY).min(1.0 / first_mode) / SAMPLES;
    (spacing / experiment.time_step).max(1.0) as u64
}

/// What follows a run from step `start` on: the states before its steps, as a recording of all of them would hold them.
fn accumulator(experiment: &Experiment, start: u64, every: u64, last: u64) -> MeasureAccumulator {
    let (robot, h) = (&experiment.robot, experiment.time_step);
    MeasureAccumulator::new(SamplingPlan {
        mount: robot.mount,
        nodes: robot.joints() + 2,
        period: experiment.drive.period(),
        first: start as f64 * h,
        last: last as f64 * h,
        samples: ((last - start) / every + 2) as usize,
        spacing: if every > 1 { every as f64 * h } else { 0.0 },
    })
}

/// Turns the recorded places of the nodes into what is seen of them, scaled, rolled and bent about the left end of the flat robot at x = `origin` (cm);
/// velocities stay those of the robot.
fn see(recording: &mut Recording, view: &View, origin: f64) {
    if view.is_plain() {
        return;
    }
    // What only shifts keeps its bits.
    let origin = if view.only_shifts() { 0.0 } else { origin };
    let width = 3 * recording.nodes();
    let late = |row: usize, column: usize| {
        let (p, v) = (&recording.positions, &recording.node_velocities);
        if view.delay == 0.0 {
            return p[row * width + column];
        }
        let at = recording.time[row] - view.delay;
        let after = recording.time.partition_point(|time| *time <= at).min(recording.len() - 1);
        // Before the first record the robot stood as in it.
        let Some(before) = after.checked_sub(1) else { return p[column] };
        let end = |row: usize| [p[row * width + column], v[row * width + column]];
        hermite(at, [recording.time[before], recording.time[after]], end(before), end(after))
    };
    let mut seen = recording.positions.clone();
    for row in 0..recording.len() {
        for node in 0..recording.nodes() {
            let [x, z] = view.of([late(row, 3 * node) - origin, late(row, 3 * node + 2)]);
            let at = row * width + 3 * node;
            (seen[at], seen[at + 2]) = (x + origin, z);
        }
    }
    recording.positions = seen;
}

/// The cubic through position and velocity at both `ends` (s), at the time `t`.
pub(crate) fn hermite(t: f64, ends: [f64; 2], [p0, v0]: [f64; 2], [p1, v1]: [f64; 2]) -> f64 {
    let h = ends[1] - ends[0];
    hermite_at((t - ends[0]) / h, h, [p0, v0], [p1, v1])
}

/// The cubic through value and slope (1/s) at both ends of an interval of `h` (s), at the share `s` of it.
pub(crate) fn hermite_at(s: f64, h: f64, [p0, v0]: [f64; 2], [p1, v1]: [f64; 2]) -> f64 {
    let (a, b) = (1.0 - s, s);
    a * a * ((1.0 + 2.0 * s) * p0 + s * h * v0) + b * b * ((1.0 + 2.0 * a) * p1 - a * h * v1)
}

/// A recording that grows in memory set aside for it.
pub(super) struct Recorder {
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
            node_velocities: of(3 * nodes),
        };
        Self { recording, nodes }
    }

    pub(super) fn record(&mut self, time: f64, engine: &mut dyn Engine) -> Result<(), EngineError> {
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
        engine.nodes(&mut r.positions[at..], &mut r.velocities[at..])?;
        r.node_velocities.extend_from_slice(&r.velocities[at..]);
        engine.correct_velocities(&mut r.node_velocities[at..])
    }
}
