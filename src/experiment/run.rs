//! The loop over steps.

use super::Experiment;
use super::range::{self, Bending, CLEARLY};
use crate::analytic;
use crate::drive::{Means, Waveform};
use crate::effects::View;
use crate::engine::{Books, ClampHits, EnergyBalance, Engine, EngineError};
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
    /// Whether the books of energy were kept: they know the plain model only.
    pub audited: bool,
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
        if bending(CLEARLY).is_none() { bending(1.0).into_iter().collect() } else { Vec::new() }
    }
}

/// Runs an experiment on an engine of its robot, from the engine's step on. `observe` is called every 256 steps, or more often for more than 64 joints, with the number of steps done.
///
/// One step, in the reference's order: the voltages are those of the *previous* step's time (0 for the first two steps); the time
/// is step · dt; joints are read and torques computed; the state before the step is recorded if its turn has come; the torques are
/// applied and the world steps. An engine that works at the middle of a step gets the step's mean voltages instead,
/// or those of several parts of the step if it asks for them. Nothing is allocated inside the loop: the recording has its final size from the start.
///
/// # Errors
/// [`EngineError`] if the simulation goes wrong; what was recorded until then is lost.
pub fn run(
    experiment: &Experiment,
    engine: &mut dyn Engine,
    mut observe: impl FnMut(u64) -> Control,
) -> Result<Run, EngineError> {
    let mut recorder = Recorder::new(experiment);
    let mut books = experiment.effects.is_empty().then(|| Books::new(&experiment.robot, experiment.time_step));
    let mut voltages = vec![0.0; experiment.robot.actuators];
    let midpoint = engine.midpoint();
    // A smooth drive needs no parts.
    let parts = if matches!(experiment.drive.waveform, Waveform::Sine { .. }) { 1 } else { engine.parts() };
    let mut pieces = vec![0.0; parts * experiment.robot.actuators];
    let observe_every = (OBSERVE_EVERY_JOINTS / experiment.robot.joints().max(1) as u64).clamp(1, OBSERVE_EVERY);
    let mut bending = Bending::default();
    let view = View::new(&experiment.effects);
    let origin = -0.5 * experiment.robot.segments()[0].length;
    let mut interrupted = false;
    let mut done = engine.step();
    let start = done;
    let (mut accumulator, every) = accumulator(experiment, start);
    let mut sampled = Every::new(start, every);
    let mut bent = Every::new(start, if midpoint { BEND_EVERY_SAMPLES * every } else { 1 });
    let mut observed = Every::new(start, observe_every);
    let mut time = done.saturating_sub(1) as f64 * experiment.time_step;
    let mut means = Means::new(&experiment.drive, experiment.robot.actuators, done as f64 * experiment.time_step);
    while done < experiment.steps {
        if observed.comes(done) && observe(done) == Control::Stop {
            interrupted = true;
            break;
        }
        let before = time;
        time = done as f64 * experiment.time_step;
        if midpoint && parts > 1 {
            let at = |part: usize| time + experiment.time_step * part as f64 / parts as f64;
            for (part, piece) in pieces.chunks_exact_mut(experiment.robot.actuators).enumerate() {
                means.over(at(part), at(part + 1), piece);
            }
            engine.prepare_parts(&pieces)?;
        } else if midpoint {
            let end = (done + 1) as f64 * experiment.time_step;
            means.over(time, end, &mut voltages);
            engine.prepare(&voltages)?;
        } else {
            experiment.drive.voltages(before, &mut voltages);
            engine.prepare(&voltages)?;
        }
        if let Some(books) = &mut books {
            books.take(engine)?;
        }
        let last = done + 1 == experiment.steps;
        let regular = sampled.comes(done) || last;
        if regular || accumulator.is_close() {
            sample(&mut accumulator, time, regular, engine, (&view, origin))?;
        }
        if experiment.records(done) {
            recorder.record(time, engine)?;
        }
        if bent.comes(done) || last {
            bending.take(&engine.joints().angles, time);
        }
        engine.advance()?;
        done += 1;
    }
    let mut recording = recorder.recording;
    recording.meta = experiment.meta(done, String::new());
    see(&mut recording, &view, origin);
    let energy = books.as_ref().map(Books::balance);
    let mut measures = Measures { energy_error: energy.map(|energy| energy.error()), ..accumulator.measures() };
    if measures.jump_height_mm.is_some() {
        measures.recorded_jump_height_mm = Some(recorded_jump_height(&recording));
    }
    Ok(Run {
        recording,
        measures,
        interrupted,
        clamp_hits: engine.clamp_hits(),
        unstable: range::unstable(experiment, engine.hardening_curvature()),
        audited: energy.is_some(),
        bending,
        energy: energy.unwrap_or_default(),
    })
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

/// What follows a run from step `start` on: the states before its steps, as a recording of all of them would hold them. And the number of
/// steps from one regular sample to the next.
fn accumulator(experiment: &Experiment, start: u64) -> (MeasureAccumulator, u64) {
    let (robot, h) = (&experiment.robot, experiment.time_step);
    let period = experiment.drive.period();
    let first_mode = analytic::cantilever_frequency(robot) * (robot.actuators as f64).powi(2);
    let spacing = period.unwrap_or(f64::INFINITY).min(1.0 / first_mode) / SAMPLES;
    let every = (spacing / h).max(1.0) as u64;
    let last = experiment.steps.saturating_sub(1).max(start);
    let plan = SamplingPlan {
        mount: robot.mount,
        nodes: robot.joints() + 2,
        period,
        first: start as f64 * h,
        last: last as f64 * h,
        samples: ((last - start) / every + 2) as usize,
        spacing: if every > 1 { every as f64 * h } else { 0.0 },
    };
    (MeasureAccumulator::new(plan), every)
}

/// Shows the robot at `time` (s) to the accumulator, as it is seen.
fn sample(
    accumulator: &mut MeasureAccumulator,
    time: f64,
    regular: bool,
    engine: &mut dyn Engine,
    (view, origin): (&View, f64),
) -> Result<(), EngineError> {
    accumulator.voltages(time, engine.motor_voltages());
    engine.places(accumulator.places())?;
    if !view.is_plain() {
        accumulator.places().iter_mut().for_each(|[x, z]| [*x, *z] = view.of([*x - origin, *z]));
        if view.delay > 0.0 && accumulator.is_new() {
            // Before the first state the robot stood as in it.
            accumulator.take(time, true);
            return sample(accumulator, time, regular, engine, (view, origin));
        }
    }
    accumulator.take(time + view.delay, regular);
    Ok(())
}

/// Turns the recorded places of the nodes into what is seen of them, scaled and rolled about the left end of the flat robot at x = `origin` (cm);
/// velocities stay those of the robot.
fn see(recording: &mut Recording, view: &View, origin: f64) {
    if view.is_plain() {
        return;
    }
    // What neither scales nor rolls keeps its bits.
    let origin = if view.scale == 1.0 && view.tilt == 0.0 { 0.0 } else { origin };
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
    let s = (t - ends[0]) / h;
    let (a, b) = (1.0 - s, s);
    a * a * ((1.0 + 2.0 * s) * p0 + s * h * v0) + b * b * ((1.0 + 2.0 * a) * p1 - a * h * v1)
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
            node_velocities: of(3 * nodes),
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
        engine.nodes(&mut r.positions[at..], &mut r.velocities[at..])?;
        r.node_velocities.extend_from_slice(&r.velocities[at..]);
        engine.correct_velocities(&mut r.node_velocities[at..])
    }
}
