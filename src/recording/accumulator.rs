//! The measures of a motion, summed sample by sample: over steps of a run, or all records of a recording.
//!
//! A run takes a sample every few steps ([`SamplingPlan::spacing`]: a hundred per period of the drive and of an actuator's first mode), and at every
//! step where the next interval might bring a new extreme at twice the last speed, or where travel is about to be counted. Extremes below 10⁻⁴ cm, or
//! peaks within one interval out of slower motion, may be missed. A clamped robot's tip moves smoothly: its extremes are those of parabolas through
//! three samples.
//!
//! States at a time between two samples (the start of a period) are interpolated linearly. Shares of time weigh each sample by half the time to
//! its neighbours.

mod clamped;
mod mobile;

use super::Recording;
use super::measures::{Measures, copy_nodes, recorded_jump_height};
use super::signal::Repetition;
use crate::model::Mount;
use clamped::Clamped;
use mobile::Mobile;

/// Samples that a period needs for phases and repetition: with fewer the drive is aliased.
pub(crate) const SAMPLES_OF_A_PERIOD: f64 = 4.0;

/// Extent and density of the samples.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SamplingPlan {
    pub mount: Mount,
    /// Number of nodes.
    pub nodes: usize,
    /// Period of the drive (s), if it repeats.
    pub period: Option<f64>,
    /// Times of the first and the last sample (s).
    pub first: f64,
    pub last: f64,
    /// Largest number of samples, without the extra ones near extremes.
    pub samples: usize,
    /// Time between the samples (s); 0 if no samples can be taken between them.
    pub spacing: f64,
}

/// Computes the measures from samples of the nodes' positions. Allocates nothing after construction.
#[derive(Debug)]
pub(crate) struct MeasureAccumulator {
    plan: SamplingPlan,
    /// Positions x, z of the nodes (cm) at the current and the previous sample.
    now: Vec<[f64; 2]>,
    before: Vec<[f64; 2]>,
    /// Time of the previous sample (s).
    time: Option<f64>,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Clamped(Box<Clamped>),
    Mobile(Box<Mobile>),
}

impl SamplingPlan {
    /// Start of the last `count` periods (s); `None` if the run is shorter.
    fn periods_before_end(&self, period: f64, count: f64) -> Option<f64> {
        let start = self.last - period * count;
        (start >= self.first - 1e-9 * period && start < self.last).then(|| start.max(self.first))
    }

    /// Start of the last half of the run in whole periods, at least one (s).
    fn half(&self, period: f64) -> Option<f64> {
        self.periods_before_end(period, whole_periods((self.last - self.first) / 2.0, period).max(1.0))
    }

    /// True if the samples resolve a period.
    fn resolves(&self, period: f64) -> bool {
        period * self.samples.saturating_sub(1) as f64 >= SAMPLES_OF_A_PERIOD * (self.last - self.first)
    }

    /// Start of the last half in whole periods (s), if the samples resolve them.
    fn resolved_half(&self, period: f64) -> Option<f64> {
        self.half(period).filter(|_| self.resolves(period))
    }

    /// Repetition of the heights over the pairs of periods in the last half. Of 12 periods the last six are compared with those one and two
    /// periods earlier.
    fn repetition(&self, period: f64) -> Option<Repetition> {
        let duration = self.last - self.first;
        let pairs = whole_periods(duration / 4.0, period);
        let enough = self.resolves(period) && pairs >= 1.0 && 2.0 * period * (pairs + 1.0) <= duration * (1.0 + 1e-9);
        enough.then(|| Repetition::new(period, pairs as usize, [self.first, self.last], self.nodes))
    }
}

/// Number of whole periods in a time (s). The last sample of a run with fixed steps is one step before its end, so 1 % of a period may be missing.
fn whole_periods(time: f64, period: f64) -> f64 {
    (time / period + 0.01).floor()
}

impl MeasureAccumulator {
    /// An accumulator without samples.
    pub fn new(plan: SamplingPlan) -> Self {
        let plan = SamplingPlan { period: plan.period.filter(|&period| period > 0.0), ..plan };
        let kind = if plan.mount == Mount::Clamped {
            Kind::Clamped(Box::new(Clamped::new(&plan)))
        } else {
            Kind::Mobile(Box::new(Mobile::new(&plan)))
        };
        let places = vec![[0.0; 2]; plan.nodes];
        Self { plan, now: places.clone(), before: places, time: None, kind }
    }

    /// True before the first sample.
    pub fn is_new(&self) -> bool {
        self.time.is_none()
    }

    /// Buffer for the nodes' x and z (cm) of the next sample.
    pub fn places(&mut self) -> &mut [[f64; 2]] {
        &mut self.now
    }

    /// Takes the joint voltages (V) at `time` (s).
    pub fn voltages(&mut self, time: f64, volts: &[f64]) {
        if let Kind::Clamped(clamped) = &mut self.kind {
            clamped.voltages(time, volts);
        }
    }

    /// True if the next step must be a sample: it might be an extreme, or travel is about to be counted.
    pub fn is_close(&self) -> bool {
        matches!(&self.kind, Kind::Mobile(mobile) if mobile.close)
    }

    /// Takes the sample at `time` (s) and keeps its [`places`](Self::places) for the next one.
    pub fn take_standing(&mut self, time: f64) {
        self.take(time, true);
        self.now.clone_from(&self.before);
    }

    /// Takes the sample at `time` (s) from [`places`](Self::places): a `regular` one or an extra one near an extreme. The first sample after the
    /// end is interpolated to the end; later ones are ignored.
    pub fn take(&mut self, mut time: f64, regular: bool) {
        let last = self.plan.last;
        if time > last * (1.0 + 1e-12) {
            let Some(before) = self.time.filter(|&before| before < last) else { return };
            let share = (last - before) / (time - before);
            for (now, before) in self.now.iter_mut().zip(&self.before) {
                (0..2).for_each(|k| now[k] = before[k] + share * (now[k] - before[k]));
            }
            time = last;
        }
        match &mut self.kind {
            Kind::Clamped(clamped) => clamped.take(time, &self.now),
            Kind::Mobile(mobile) => {
                let before = self.time.map(|time| (time, &self.before[..]));
                mobile.take(time, &self.now, before, regular, self.plan.spacing);
            }
        }
        self.time = Some(time);
        std::mem::swap(&mut self.now, &mut self.before);
    }

    /// The measures; of an interrupted motion only those that do not need its end.
    pub fn measures(&self) -> Measures {
        let Some(time) = self.time.filter(|&time| time > self.plan.first) else { return Measures::default() };
        let ended = time >= self.plan.last * (1.0 - 1e-12);
        match &self.kind {
            Kind::Clamped(clamped) => clamped.measures(&self.plan, ended),
            Kind::Mobile(mobile) => mobile.measures(&self.plan, &self.before, time, ended),
        }
    }
}

impl Measures {
    /// Computes measures from the records of a recording; the motion between records is unknown, so prefer a run's own measures,
    /// [`Run::measures`](crate::experiment::Run). `period` (s): that of the drive, if it repeats.
    pub fn of(recording: &Recording, mount: Mount, period: Option<f64>) -> Self {
        let (Some(&first), Some(&last)) = (recording.time.first(), recording.time.last()) else { return Self::default() };
        let samples = recording.len();
        let plan = SamplingPlan { mount, nodes: recording.nodes(), period, first, last, samples, spacing: 0.0 };
        let mut accumulator = MeasureAccumulator::new(plan);
        for (record, &time) in recording.time.iter().enumerate() {
            copy_nodes(recording, record, accumulator.places());
            accumulator.take(time, true);
            if let Some(volts) = recording.motor_voltages.chunks_exact(recording.joints().max(1)).nth(record) {
                accumulator.voltages(time, volts);
            }
        }
        let mut measures = accumulator.measures();
        if measures.jump_height_mm.is_some() {
            measures.recorded_jump_height_mm = Some(recorded_jump_height(recording));
        }
        measures
    }
}
