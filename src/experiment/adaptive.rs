//! Steps that adapt to the motion, so that the error of each one stays below a tolerance.
//!
//! A step is taken in two halves of length h. Taken whole it would end elsewhere: where nothing happens by h³/2 (x⃛ + 12 D ẍ), with the places x of the nodes and the
//! numerical damping D. The largest such distance is its local error, and the next step is as long as the error says, up to 1 ms. Derivatives are those of the
//! mean velocities over both halves and over the half step before. Velocities at single times would not do: those that springs and dampers dictate may
//! alternate. Where the half step before says nothing, after an impact and where voltages jump, the step is taken whole, too.
//!
//! The error of a corner that lands within a step is its velocity times h. So steps end where the next corner lands: the landing is foreseen from
//! heights and velocities, again and again as it comes nearer, and then one very short step, twice as long as what is left, takes the impact at once
//! (Moreau's law) and ends exactly on the floor. Where other corners touch, an impact in two stages would have another result, and nothing may be left
//! below the floor: what pushes a corner out interrupts its contact, which on films of high friction has been seen to decide where a robot goes.
//! Landings too slow to matter within a step are left to it, as are corners that begin to slide, stick or leave: their accelerations jump, which costs
//! an error of second order that the control sees.
//!
//! Events may accumulate, as when a body rocks to rest. Each is slower than the one before, and those that would move nothing by the tolerance
//! are not resolved; nor is what happens within 10⁻⁸ s.
//!
//! Steps also end where voltages jump and where a run can be stopped. Records lie within steps: each is taken from a shorter step aside, so that they
//! change nothing.
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
/// What happens within this time (s) happens at once: steps are not cut below it, but for those of an impact.
const SHORTEST: f64 = 1e-8;
/// The shortest half of an impact's step (s).
const SHORTEST_IMPACT: f64 = 1e-10;
/// What rounding leaves of a stretch of time (s), after thousands of steps.
const SLIVER: f64 = 1e-10;
/// Impacts that follow on each other at once; those after are left to ordinary steps.
const MOST_IMPACTS: u32 = 200;
/// Steps to a landing that are shorter than this share of what the error allows are not controlled: their errors are of the order of its cube.
const SHORT: f64 = 0.1;
/// Share that is taken of the step that the error allows.
const SAFETY: f64 = 0.9;
/// Least and largest factor from one step to the next.
const SHRINK: f64 = 0.2;
const GROW: f64 = 4.0;
/// Share of the step before an impact or a jump of voltages that is tried after it. Measured: with a half 4 %, with a fifth or a tenth 7 % fewer steps are solved in
/// all than with the whole.
const ANEW: f64 = 0.2;

/// How many steps a run took, halves and rejected ones included, and the shortest and longest that were kept (s).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StepCount {
    pub taken: u64,
    pub shortest: f64,
    pub longest: f64,
}

/// Why a run has no end.
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

/// Places of the nodes in the middle of the step before, at a step's start, at its middle and end if it is taken in two halves, and at its end if it is taken
/// whole.
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
    /// Impacts that have followed on each other at once.
    impacts: u32,
    /// How long the next step may be (s), as far as errors say.
    wanted: f64,
    /// Half of the step before (s), if accelerations go on from it.
    half_before: Option<f64>,
    /// Weight of a step's end less ½, per length of the step (1/s).
    damping: f64,
    observation: Observation<'a>,
    supply: Supply<'a>,
    /// In steps of the experiment: how far regular samples are apart and the next one; the next that may be recorded.
    every: u64,
    next_sample: u64,
    next_record: u64,
    nodes: [Vec<[f64; 2]>; 5],
    /// Of the engine at a step's start, and at its end.
    checkpoints: [Vec<f64>; 2],
}

/// A stretch of time (s) that a step or a part of one covers.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    from: f64,
    length: f64,
    /// Whether it ends where a corner lands, which it must reach freely.
    lands: bool,
}

impl AdaptiveRun<'_> {
    /// Takes in the state that the run begins with.
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

    /// From `time` to `end` (s).
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
            // No sliver is left over.
            let length = if wanted < left && left < 1.5 * wanted { 0.5 * left } else { wanted.min(left) };
            let landing = engine.landing(self.tolerance / length);
            if landing <= SHORTEST && landing < left && self.impacts < MOST_IMPACTS {
                self.impacts += 1;
                // The landing is in the middle, and what lands stops.
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
            // What is left until the landing is half of an impact's step.
            let stretch = Stretch { from: time, length: if lands { landing - 0.5 * SHORTEST } else { length }, lands };
            if lands && stretch.length < SHORT * wanted {
                self.take_at_once(engine, stretch)?;
                time += stretch.length;
                continue;
            }
            let (taken, next) = self.take_step(engine, stretch)?;
            // A step that was short for another reason says nothing against longer ones.
            let unhindered = taken == stretch.length && taken < wanted;
            self.wanted = if unhindered { next.max(wanted) } else { next }.min(LONGEST);
            time = if !lands && taken == left { until } else { time + taken };
            if time == jump {
                self.begin_anew();
            }
        }
        Ok(())
    }

    /// After what makes accelerations jump.
    fn begin_anew(&mut self) {
        if self.half_before.take().is_some() {
            self.wanted *= ANEW;
        }
    }

    /// Takes a step in one piece, whatever its error.
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

    /// Takes a step of that stretch or a shorter one; returns its length and that of the next one.
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

    /// Takes a step in halves; returns how far from there it would end if it were taken whole (cm).
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
                // Between the middle of the step and halfway between the centres of the half before and of the first half.
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

    /// The same without counting the step.
    fn advance_aside(&mut self, engine: &mut dyn Engine, Stretch { from, length, lands }: Stretch) -> Result<(), Stopped> {
        engine.set_time_step(length, Some(if lands { 0.0 } else { 0.5 * length }))?;
        self.supply.prepare_smooth(engine, from, from + length)?;
        Ok(engine.advance()?)
    }

    /// Gives the engine the voltages of the time `time` (s).
    fn prepare_at(&mut self, engine: &mut dyn Engine, time: f64) -> Result<(), EngineError> {
        engine.set_time_step(SHORTEST, Some(SHORTEST))?;
        self.supply.prepare_smooth(engine, time, time + SHORTEST)
    }

    /// Takes in what is to be seen after the start of a step that was just taken, until its end.
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
