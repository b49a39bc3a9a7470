//! Adaptive steps, each with a local error below a tolerance.
//!
//! A step is taken in two halves of length h. Its local error is the distance to where the whole step would end, h³/2 (x⃛ + 12 D ẍ) in smooth motion, with the
//! nodes' positions x and the numerical damping D; the largest over the nodes sets the length of the next step, up to 1 ms. The derivatives come from mean
//! velocities over both halves and the half step before, for velocities at single times may alternate. After an impact and where voltages jump the half
//! step before is of no use, so the step is also taken whole.
//!
//! A landing within a step would cost an error of velocity times h. So steps end where the next corner lands: the landing is predicted from heights and
//! velocities, repeatedly as it comes nearer, and one very short step, twice as long as the time left, takes the whole impact (Moreau's law) and ends exactly on
//! the floor. Where other corners touch, an impact in two stages would have another result; and a penetration left over would be pushed out, which interrupts
//! contact. Landings too slow to matter stay within a step, as do corners that begin to slide, stick or leave: their accelerations jump, an error of
//! second order that the control sees.
//!
//! Events may accumulate, as when a body rocks to rest. Each is slower than the one before; those that move nothing by the tolerance are not resolved, nor is
//! anything within 10⁻⁸ s.
//!
//! Steps also end where voltages jump and where a run can be stopped. Records lie within steps: each is taken from a shorter step on a copy of the state, so
//! that they change nothing.
//!
//! E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I* (1993), II.4 (step size control); V. Acary, B. Brogliato,
//! *Numerical Methods for Nonsmooth Dynamical Systems* (2008), chapter 8 (event-driven schemes and accumulations).

use super::Experiment;
use super::run::{Control, Observation, Run, Supply, sample_every};
use crate::engine::{Engine, EngineError, NUMERICAL_DAMPING};
use crate::model::Mount;

/// The longest step (s).
pub(super) const LONGEST: f64 = 1e-3;
/// Longest steps between two calls of the observer, which may stop a run.
const OBSERVE_EVERY: u64 = 16;
/// Shortest step (s), except for impacts; events within it are simultaneous.
const SHORTEST: f64 = 1e-8;
/// The shortest half of an impact's step (s).
const SHORTEST_IMPACT: f64 = 1e-10;
/// Rounding of a time (s) after thousands of steps.
const SLIVER: f64 = 1e-10;
/// Impacts in direct succession; later ones are left to ordinary steps.
const MOST_IMPACTS: u32 = 200;
/// Steps to a landing below this fraction of the allowed length are not controlled: their errors are of the order of its cube.
const SHORT: f64 = 0.1;
/// Safety factor on the length that the error allows.
const SAFETY: f64 = 0.9;
/// Least and largest factor from one step to the next.
const SHRINK: f64 = 0.2;
const GROW: f64 = 4.0;
/// Fraction of the last length that is tried after an impact or a jump of voltages.
const ANEW: f64 = 0.2;

/// Number of steps of a run, halves and rejected ones included, and the shortest and longest step accepted (s).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StepCount {
    pub taken: u64,
    pub shortest: f64,
    pub longest: f64,
}

/// Why a run stopped early.
pub(super) enum Stopped {
    Failed(EngineError),
    /// It would have taken more steps than allowed.
    TooLong,
}

impl From<EngineError> for Stopped {
    fn from(error: EngineError) -> Self {
        Self::Failed(error)
    }
}

/// Runs an experiment from the engine's state on with steps of a local error of `tolerance` (cm) at most, of which at most `most` are taken.
pub(super) fn run(
    experiment: &Experiment,
    tolerance: f64,
    most: u64,
    engine: &mut dyn Engine,
    mut observe: impl FnMut(u64) -> Control,
) -> Result<(Run, StepCount), Stopped> {
    let grid = experiment.time_step;
    let longest = (LONGEST / grid).round().max(1.0) as u64;
    let mut done = engine.step();
    let every = sample_every(experiment);
    let mut run = AdaptiveRun {
        observation: Observation::new(experiment, done, every, experiment.steps),
        supply: Supply::new(experiment, engine, done as f64 * grid),
        experiment,
        tolerance,
        most,
        count: StepCount { taken: 0, shortest: f64::INFINITY, longest: 0.0 },
        impacts: 0,
        wanted: LONGEST,
        half_before: None,
        damping: experiment.numerical_damping.unwrap_or(NUMERICAL_DAMPING),
        every,
        next_sample: done + every,
        next_record: done + 1,
        nodes: [(); 5].map(|()| vec![[0.0; 2]; experiment.robot.joints() + 2]),
        checkpoints: Default::default(),
    };
    run.begin(engine, done)?;
    let mut interrupted = false;
    while done < experiment.steps {
        if observe(done) == Control::Stop {
            interrupted = true;
            break;
        }
        let block = OBSERVE_EVERY * longest;
        let end = (done - done % block + block).min(experiment.steps);
        run.advance(engine, done as f64 * grid, end as f64 * grid).map_err(|stopped| match stopped {
            Stopped::Failed(error) => Stopped::Failed(error.at((done, done as f64 * grid))),
            too_long @ Stopped::TooLong => too_long,
        })?;
        done = end;
        engine.set_step(done);
    }
    engine.set_time_step(grid, None)?;
    Ok((run.observation.finish(engine, done, interrupted), run.count))
}

/// Indices of the nodes' positions: middle of the step before, start, middle and end of the step in two halves, and end of the whole step.
const BEFORE: usize = 0;
const START: usize = 1;
const MIDDLE: usize = 2;
const END: usize = 3;
const WHOLE: usize = 4;

struct AdaptiveRun<'a> {
    experiment: &'a Experiment,
    tolerance: f64,
    /// Steps that may be taken.
    most: u64,
    count: StepCount,
    /// Impacts in direct succession so far.
    impacts: u32,
    /// Length of the next step that the error allows (s).
    wanted: f64,
    /// Half of the step before (s), if accelerations are continuous from there.
    half_before: Option<f64>,
    /// D, the engine's numerical damping (1/s).
    damping: f64,
    observation: Observation<'a>,
    supply: Supply<'a>,
    /// In multiples of the record grid: spacing of regular samples, the next sample, and the next possible record.
    every: u64,
    next_sample: u64,
    next_record: u64,
    nodes: [Vec<[f64; 2]>; 5],
    /// The engine at a step's start and at its end.
    checkpoints: [Vec<f64>; 2],
}

/// The interval of time (s) of a step or a part of one.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    from: f64,
    length: f64,
    /// True if it ends where a corner lands, which contact must not stop before.
    lands: bool,
}

impl AdaptiveRun<'_> {
    /// Samples and records the initial state.
    fn begin(&mut self, engine: &mut dyn Engine, step: u64) -> Result<(), EngineError> {
        let time = step as f64 * self.experiment.time_step;
        engine.places(&mut self.nodes[START])?;
        engine.checkpoint(&mut self.checkpoints[0])?;
        self.prepare_at(engine, time)?;
        self.observation.accumulator.places().copy_from_slice(&self.nodes[START]);
        self.observation.take_sample(time, true, engine.motor_voltages());
        if let Some(audit) = &mut self.observation.audit {
            audit.take(time, engine)?;
        }
        if self.experiment.records(step) {
            self.observation.recorder.record(time, engine)?;
        }
        engine.rewind(&self.checkpoints[0])
    }

    /// Steps from `time` to `end` (s).
    fn advance(&mut self, engine: &mut dyn Engine, mut time: f64, end: f64) -> Result<(), Stopped> {
        while time < end {
            let jump = self.experiment.drive.next_jump(time + SHORTEST);
            let until = jump.min(end);
            let left = until - time;
            if left < SLIVER {
                time = until;
                if time == jump {
                    self.begin_anew();
                }
                continue;
            }
            let wanted = self.wanted;
            // Two equal steps instead of a long and a tiny one.
            let length = if wanted < left && left < 1.5 * wanted { 0.5 * left } else { wanted.min(left) };
            let landing = engine.landing(self.tolerance / length);
            if landing <= SHORTEST && landing < left && self.impacts < MOST_IMPACTS {
                self.impacts += 1;
                // With the landing in the middle, the corner ends on the floor.
                let length = 2.0 * landing.max(SHORTEST_IMPACT).min(0.5 * left);
                self.take_at_once(engine, Stretch { from: time, length, lands: false })?;
                self.begin_anew();
                time += length;
                continue;
            }
            if landing > SHORTEST {
                self.impacts = 0;
            }
            let lands = landing > SHORTEST && landing < length;
            // The time left until the landing is half of the impact's step.
            let stretch = Stretch { from: time, length: if lands { landing - 0.5 * SHORTEST } else { length }, lands };
            if lands && stretch.length < SHORT * wanted {
                self.take_at_once(engine, stretch)?;
                time += stretch.length;
                continue;
            }
            let (taken, next) = self.take_step(engine, stretch)?;
            // A step that was short for another reason does not shorten the next ones.
            let unhindered = taken == stretch.length && taken < wanted;
            self.wanted = if unhindered { next.max(wanted) } else { next }.min(LONGEST);
            time = if !lands && taken == left { until } else { time + taken };
            if time == jump {
                self.begin_anew();
            }
        }
        Ok(())
    }

    /// Accelerations have jumped: shortens the next step, which is to be taken whole as well.
    fn begin_anew(&mut self) {
        if self.half_before.take().is_some() {
            self.wanted *= ANEW;
        }
    }

    /// Takes a step in one piece, without error control.
    fn take_at_once(&mut self, engine: &mut dyn Engine, stretch: Stretch) -> Result<(), Stopped> {
        self.keep_start(engine)?;
        self.advance_by(engine, stretch)?;
        engine.places(&mut self.nodes[END])?;
        let [_, start, middle, end, _] = &mut self.nodes;
        for (to, (a, b)) in middle.iter_mut().zip(start.iter().zip(&*end)) {
            *to = [0, 1].map(|k| 0.5 * (a[k] + b[k]));
        }
        self.take_in(engine, stretch)?;
        // Where the step began.
        self.nodes.swap(BEFORE, END);
        self.half_before = self.half_before.map(|_| stretch.length);
        Ok(())
    }

    /// Takes a step over `stretch` or a shorter one; returns its length and that of the next one (s).
    fn take_step(&mut self, engine: &mut dyn Engine, mut stretch: Stretch) -> Result<(f64, f64), Stopped> {
        self.keep_start(engine)?;
        loop {
            let shortest = stretch.length <= SHORTEST;
            let error = match self.try_step(engine, stretch) {
                Err(Stopped::Failed(_)) if !shortest => f64::INFINITY,
                error => error?,
            };
            let factor = SAFETY * (self.tolerance / error).cbrt();
            if error <= self.tolerance || shortest {
                self.count.shortest = self.count.shortest.min(stretch.length);
                self.count.longest = self.count.longest.max(stretch.length);
                self.take_in(engine, stretch)?;
                self.nodes.swap(BEFORE, MIDDLE);
                self.half_before = Some(0.5 * stretch.length);
                return Ok((stretch.length, (stretch.length * factor.clamp(SHRINK, GROW)).max(SHORTEST)));
            }
            engine.rewind(&self.checkpoints[0])?;
            stretch.length = (factor.max(SHRINK) * stretch.length).max(SHORTEST);
        }
    }

    fn keep_start(&mut self, engine: &mut dyn Engine) -> Result<(), EngineError> {
        self.checkpoints[0].clear();
        engine.checkpoint(&mut self.checkpoints[0])
    }

    /// Takes a step in halves; returns its local error (cm).
    fn try_step(&mut self, engine: &mut dyn Engine, stretch: Stretch) -> Result<f64, Stopped> {
        if self.half_before.is_none() {
            self.advance_by(engine, stretch)?;
            engine.places(&mut self.nodes[WHOLE])?;
            engine.rewind(&self.checkpoints[0])?;
        }
        let half = Stretch { length: 0.5 * stretch.length, ..stretch };
        self.advance_by(engine, half)?;
        engine.places(&mut self.nodes[MIDDLE])?;
        self.advance_by(engine, Stretch { from: half.from + half.length, ..half })?;
        engine.places(&mut self.nodes[END])?;
        let [before, start, middle, end, whole] = self.nodes.each_ref().map(|nodes| nodes.as_flattened());
        Ok(match self.half_before {
            None => largest(whole.iter().zip(end).map(|(a, b)| a - b)),
            Some(length) => {
                let h = half.length;
                // Time between the two second differences.
                let apart = 0.25 * (3.0 * h + length);
                let (per_half, per_before, per_mean, per_apart) = (1.0 / h, 1.0 / length, 2.0 / (h + length), 1.0 / apart);
                let places = before.iter().zip(start).zip(middle.iter().zip(end));
                let errors = places.map(|((a, b), (c, d))| {
                    let [u, v, w] = [(b - a) * per_before, (c - b) * per_half, (d - c) * per_half];
                    let (acceleration, acceleration_before) = ((w - v) * per_half, (v - u) * per_mean);
                    let third = (acceleration - acceleration_before) * per_apart;
                    third.abs() + 12.0 * self.damping * acceleration.abs()
                });
                0.5 * h * h * h * largest(errors)
            }
        })
    }

    /// Moves the engine over a stretch in one step.
    fn advance_by(&mut self, engine: &mut dyn Engine, stretch: Stretch) -> Result<(), Stopped> {
        if self.count.taken == self.most {
            return Err(Stopped::TooLong);
        }
        self.count.taken += 1;
        self.advance_aside(engine, stretch)
    }

    /// [`advance_by`](Self::advance_by) without counting the step.
    fn advance_aside(&mut self, engine: &mut dyn Engine, Stretch { from, length, lands }: Stretch) -> Result<(), Stopped> {
        engine.set_time_step(length, Some(if lands { 0.0 } else { 0.5 * length }))?;
        self.supply.prepare_smooth(engine, from, from + length)?;
        Ok(engine.advance()?)
    }

    /// Gives the engine the voltages at `time` (s).
    fn prepare_at(&mut self, engine: &mut dyn Engine, time: f64) -> Result<(), EngineError> {
        engine.set_time_step(SHORTEST, Some(SHORTEST))?;
        self.supply.prepare_smooth(engine, time, time + SHORTEST)
    }

    /// Samples, records and audits a step just taken, its start excluded.
    fn take_in(&mut self, engine: &mut dyn Engine, stretch: Stretch) -> Result<(), Stopped> {
        let end = stretch.from + stretch.length;
        let regular = self.sample(engine, stretch);
        self.record(engine, stretch)?;
        if regular {
            self.observation.bending.take(&engine.joints().angles, end);
        }
        if let Some(audit) = &mut self.observation.audit {
            audit.take(end, engine)?;
        }
        self.nodes.swap(START, END);
        Ok(())
    }

    /// Takes samples for the measures: regular ones from the parabola through start, middle and end, and, of a robot that moves about, the
    /// middle and the end too, for extremes. Whether there were regular ones.
    fn sample(&mut self, engine: &dyn Engine, Stretch { from, length, .. }: Stretch) -> bool {
        let grid = self.experiment.time_step;
        let extremes = self.experiment.robot.mount != Mount::Clamped;
        let first = self.next_sample;
        for (place, until) in [(MIDDLE, from + 0.5 * length), (END, from + length)] {
            let mut last = f64::NEG_INFINITY;
            // A run ends within a sliver of its end.
            while self.next_sample as f64 * grid <= until + SLIVER {
                last = self.next_sample as f64 * grid;
                let share = (last - from) / length;
                let weights = [(1.0 - share) * (1.0 - 2.0 * share), 4.0 * share * (1.0 - share), share * (2.0 * share - 1.0)];
                let nodes = [START, MIDDLE, END].map(|k| &self.nodes[k]);
                for (i, to) in self.observation.accumulator.places().iter_mut().enumerate() {
                    *to = [0, 1].map(|k| (0..3).map(|j| weights[j] * nodes[j][i][k]).sum());
                }
                self.observation.take_sample(last, true, engine.motor_voltages());
                self.next_sample = self.after(self.next_sample);
            }
            if extremes && last < until {
                self.observation.accumulator.places().copy_from_slice(&self.nodes[place]);
                self.observation.take_sample(until, false, engine.motor_voltages());
            }
        }
        self.next_sample > first
    }

    /// The regular sample after `sample`. The last is at the end.
    fn after(&self, sample: u64) -> u64 {
        let last = self.experiment.steps;
        if sample < last { (sample + self.every).min(last) } else { sample + self.every }
    }

    /// Records what falls into a step: of each record a shorter step to it is taken aside.
    fn record(&mut self, engine: &mut dyn Engine, stretch: Stretch) -> Result<(), Stopped> {
        let grid = self.experiment.time_step;
        let (middle, end) = (stretch.from + 0.5 * stretch.length, stretch.from + stretch.length);
        let mut aside = false;
        while self.next_record < self.experiment.steps && self.next_record as f64 * grid <= end + SLIVER {
            let at = self.next_record as f64 * grid;
            if self.experiment.records(self.next_record) {
                if !aside {
                    aside = true;
                    self.checkpoints[1].clear();
                    engine.checkpoint(&mut self.checkpoints[1])?;
                }
                engine.rewind(&self.checkpoints[0])?;
                let mut from = stretch.from;
                for to in [middle.min(at), at] {
                    if to > from {
                        self.advance_aside(engine, Stretch { from, length: to - from, lands: stretch.lands })?;
                        from = to;
                    }
                }
                self.prepare_at(engine, at)?;
                self.observation.recorder.record(at, engine)?;
            }
            self.next_record += 1;
        }
        if aside { Ok(engine.rewind(&self.checkpoints[1])?) } else { Ok(()) }
    }
}

/// The largest magnitude of some numbers; infinite if one is none.
fn largest(of: impl Iterator<Item = f64>) -> f64 {
    let (mut most, mut sum) = (0.0, 0.0);
    for value in of.map(f64::abs) {
        most = if value > most { value } else { most };
        sum += value;
    }
    if sum.is_finite() { most } else { f64::INFINITY }
}
