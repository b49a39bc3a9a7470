//! The measures of a motion, added up from sample to sample: steps of a run, or all records of a recording.
//!
//! A run chooses its samples itself ([`SamplingPlan::spacing`]): so many steps apart that a hundred fall into a period of the drive and of an actuator's
//! first mode. Where the next interval might bring a new extreme, by twice the speeds of the last, every step is a sample. What is less than 10⁻⁴ cm, or rises and falls within one interval out of slower motion, may be
//! missed. Every step is a sample also before travel begins to be counted. A clamped robot's tip moves smoothly: its extremes are tops of parabolas through three samples.
//!
//! What belongs to a time between two samples (where a period begins) lies on the straight line between them. Shares of the time count half
//! the time to the samples on either side.

use super::measures::{ContactState, Measures, contact_state};
use super::signal::{HarmonicSums, Mode, Repetition, parabola_top, phase_difference_deg};
use crate::model::Mount;
use crate::model::units::mm_from_cm;

/// Largest [`Repetition::of`] that still counts as the same motion. Measured at 14 Hz: 0.01 to 0.1 after two periods, 0.6 after one.
const SAME: f64 = 0.2;
/// Samples of a ringing tip that are kept at most: at the run's spacing the first two thousand periods of the first mode.
const RINGING: usize = 1 << 20;
/// Numbers that they and the voltages with them may be (128 MB).
const RINGING_VALUES: usize = 1 << 24;

/// Voltages within this share of their travel from the last one stand still: a jump with 5 % of creep does.
const STILL: f64 = 0.1;

/// Samples that a period needs for phases and repetition: with fewer the drive is aliased.
pub(crate) const SAMPLES_OF_A_PERIOD: f64 = 4.0;

/// Part of an extreme that need not be followed (cm).
const NEGLIGIBLE: f64 = 1e-4;

/// Of what samples are taken, and when.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SamplingPlan {
    pub mount: Mount,
    /// Number of nodes.
    pub nodes: usize,
    /// The drive's period (s), if it repeats.
    pub period: Option<f64>,
    /// Times of the first and the last sample (s).
    pub first: f64,
    pub last: f64,
    /// Number of samples at most, but for those of every step near an extreme.
    pub samples: usize,
    /// Time between the samples (s); 0 if what happens between them is beyond reach.
    pub spacing: f64,
}

/// Takes samples of the nodes' places, and tells the measures of all that it was given. Allocates nothing after it is made.
#[derive(Debug)]
pub(crate) struct MeasureAccumulator {
    plan: SamplingPlan,
    /// Places of the nodes (cm) at the sample being taken and at the one before.
    now: Vec<[f64; 2]>,
    before: Vec<[f64; 2]>,
    /// Time of the sample before.
    time: Option<f64>,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Clamped(Box<Clamped>),
    Mobile(Box<Mobile>),
}

/// Heights of a clamped robot's tip, in mm.
#[derive(Debug)]
struct Clamped {
    tip: f64,
    low: f64,
    high: f64,
    /// When the samples begin that `low` and `high` are of (s).
    from: f64,
    /// Of the tip and of the voltage.
    harmonics: Option<[HarmonicSums<1>; 2]>,
    /// Times and heights of a tip that rings.
    ringing: [Vec<f64>; 2],
    /// Times and joints' voltages of the same.
    voltages: [Vec<f64>; 2],
    /// The last two samples' times and heights.
    last: [(f64, f64); 2],
}

#[derive(Debug)]
struct Mobile {
    jump_height: f64,
    /// Sum of both ends' x in the first sample, and the largest since (cm).
    ends: [f64; 2],
    /// Time (s) in each state of contact, and the last sample's.
    lasting: [f64; 3],
    state: ContactState,
    /// Whether the next step might be an extreme.
    close: bool,
    /// When travel begins to be counted (s) and the nodes' mean x then (cm): over the last period and over the last half of the run.
    stride: Option<Start>,
    speed: Option<Start>,
    harmonics: Option<HarmonicSums<2>>,
    repetition: Option<Repetition>,
}

#[derive(Debug, Clone, Copy)]
struct Start {
    time: f64,
    mean_x: Option<f64>,
}

impl SamplingPlan {
    /// When the last `count` periods begin, if there are so many.
    fn periods_before_end(&self, period: f64, count: f64) -> Option<f64> {
        let start = self.last - period * count;
        (start >= self.first - 1e-9 * period && start < self.last).then(|| start.max(self.first))
    }

    /// When the last half begins in whole periods, at least one.
    fn half(&self, period: f64) -> Option<f64> {
        self.periods_before_end(period, whole_periods((self.last - self.first) / 2.0, period).max(1.0))
    }

    /// Whether the samples follow what happens within a period.
    fn resolves(&self, period: f64) -> bool {
        period * self.samples.saturating_sub(1) as f64 >= SAMPLES_OF_A_PERIOD * (self.last - self.first)
    }

    /// When the last half begins in whole periods, if the samples follow what happens in them.
    fn resolved_half(&self, period: f64) -> Option<f64> {
        self.half(period).filter(|_| self.resolves(period))
    }

    /// Pairs of periods in the last half, and how the heights repeat in them. At 12 periods the last six are compared with the six that
    /// began one or two periods before.
    fn repetition(&self, period: f64) -> Option<Repetition> {
        let duration = self.last - self.first;
        let pairs = whole_periods(duration / 4.0, period);
        let enough = self.resolves(period) && pairs >= 1.0 && 2.0 * period * (pairs + 1.0) <= duration * (1.0 + 1e-9);
        enough.then(|| Repetition::new(period, pairs as usize, [self.first, self.last], self.nodes))
    }
}

/// Number of whole periods in a time (s). The last sample of a run of fixed steps is a step before its end, so a hundredth of a period may lack.
fn whole_periods(time: f64, period: f64) -> f64 {
    (time / period + 0.01).floor()
}

impl MeasureAccumulator {
    pub fn new(plan: SamplingPlan) -> Self {
        let plan = SamplingPlan { period: plan.period.filter(|&period| period > 0.0), ..plan };
        let period = plan.period;
        let kind = if plan.mount == Mount::Clamped {
            let half = period.and_then(|period| Some((plan.resolved_half(period)?, period)));
            let rings = if period.is_none() { plan.samples.min(RINGING).min(RINGING_VALUES / (plan.nodes + 1)) } else { 0 };
            Kind::Clamped(Box::new(Clamped {
                tip: 0.0,
                low: f64::INFINITY,
                high: f64::NEG_INFINITY,
                from: period.and_then(|period| plan.periods_before_end(period, 1.0)).unwrap_or(plan.first),
                harmonics: half.map(|(from, period)| [(); 2].map(|()| HarmonicSums::new(1.0 / period, from))),
                ringing: [Vec::with_capacity(rings), Vec::with_capacity(rings)],
                voltages: [Vec::with_capacity(rings), Vec::with_capacity(rings * (plan.nodes - 2))],
                last: [(f64::NAN, f64::NAN); 2],
            }))
        } else {
            let half = period.and_then(|period| Some((plan.resolved_half(period)?, period)));
            let begin = |time: f64| Start { time, mean_x: None };
            Kind::Mobile(Box::new(Mobile {
                jump_height: f64::NEG_INFINITY,
                ends: [0.0; 2],
                lasting: [0.0; 3],
                state: ContactState::Aerial,
                close: false,
                stride: period.and_then(|period| plan.periods_before_end(period, 1.0)).map(begin),
                speed: if let Some(period) = period { plan.half(period).map(begin) } else { Some(begin(plan.first)) },
                harmonics: half.map(|(from, period)| HarmonicSums::new(1.0 / period, from)),
                repetition: period.and_then(|period| plan.repetition(period)),
            }))
        };
        let places = vec![[0.0; 2]; plan.nodes];
        Self { plan, now: places.clone(), before: places, time: None, kind }
    }

    /// Whether nothing was taken yet.
    pub fn is_new(&self) -> bool {
        self.time.is_none()
    }

    /// Where the nodes' x and z (cm) of the coming sample are to be written.
    pub fn places(&mut self) -> &mut [[f64; 2]] {
        &mut self.now
    }

    /// Takes the voltages on the joints (V) at `time` (s).
    pub fn voltages(&mut self, time: f64, volts: &[f64]) {
        let Kind::Clamped(clamped) = &mut self.kind else { return };
        if let Some([_, of_volts]) = &mut clamped.harmonics {
            of_volts.push(time, [volts.first().copied().unwrap_or(0.0)]);
        }
        let [times, all] = &mut clamped.voltages;
        if times.len() < times.capacity() {
            times.push(time);
            all.extend_from_slice(volts);
        }
    }

    /// Whether the next step must be a sample: it might be an extreme, or travel begins to be counted.
    pub fn is_close(&self) -> bool {
        matches!(&self.kind, Kind::Mobile(mobile) if mobile.close)
    }

    /// Takes the sample of `time` (s) without using up its [`places`](Self::places): those of the next one are the same.
    pub fn take_standing(&mut self, time: f64) {
        self.take(time, true);
        self.now.clone_from(&self.before);
    }

    /// Takes the sample of `time` (s), which is [`places`](Self::places): a `regular` one or one more near an extreme. Of the first sample
    /// after the end what lies on it is taken, and of later ones nothing.
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

    /// The measures; of a motion that did not reach its end those that need no end.
    pub fn measures(&self) -> Measures {
        let Some(time) = self.time.filter(|&time| time > self.plan.first) else { return Measures::default() };
        let ended = time >= self.plan.last * (1.0 - 1e-12);
        match &self.kind {
            Kind::Clamped(clamped) => clamped.measures(&self.plan, ended),
            Kind::Mobile(mobile) => mobile.measures(&self.plan, &self.before, time, ended),
        }
    }
}

impl Clamped {
    fn take(&mut self, time: f64, nodes: &[[f64; 2]]) {
        self.tip = mm_from_cm(nodes[nodes.len() - 1][1]);
        let sample = (time, self.tip);
        if time >= self.from {
            (self.low, self.high) = (self.low.min(self.tip), self.high.max(self.tip));
            let [a, b] = self.last;
            if a.0 >= self.from && (b.1 - a.1) * (self.tip - b.1) < 0.0 {
                let top = parabola_top([a.0, b.0, time], [a.1, b.1, self.tip]).map_or(b.1, |top| top.1);
                (self.low, self.high) = (self.low.min(top), self.high.max(top));
            }
        }
        self.last = [self.last[1], sample];
        if let Some([of_tip, _]) = &mut self.harmonics {
            of_tip.push(time, [self.tip]);
        }
        let [times, heights] = &mut self.ringing;
        if times.len() < times.capacity() {
            times.push(time);
            heights.push(self.tip);
        }
    }

    /// When all voltages begin to keep to their last value, but for creep and the like (s): what moves then rings, what moves before is driven.
    fn still_from(&self) -> Option<f64> {
        let [times, volts] = &self.voltages;
        let rows: Vec<&[f64]> = volts.chunks_exact((volts.len() / times.len().max(1)).max(1)).collect();
        let last = rows.last()?;
        let away = |row: &[f64]| row.iter().zip(*last).fold(0.0_f64, |most, (v, end)| most.max((v - end).abs()));
        let range = rows.iter().fold(0.0_f64, |most, row| most.max(away(row)));
        let size = rows.iter().flat_map(|row| row.iter()).fold(0.0_f64, |most, v| most.max(v.abs()));
        if range <= STILL * size {
            return times.first().copied();
        }
        times.get(rows.iter().rposition(|row| away(row) > STILL * range).map_or(0, |row| row + 1)).copied()
    }

    fn measures(&self, plan: &SamplingPlan, ended: bool) -> Measures {
        let mut measures = Measures { tip_deflection_mm: Some(self.tip), ..Measures::default() };
        if plan.period.is_some() && !ended {
            return measures;
        }
        measures.tip_amplitude_mm = Some((self.high - self.low) / 2.0);
        if let Some([tip, volts]) = &self.harmonics {
            let pair = tip.phases_deg()[0].zip(volts.phases_deg()[0]);
            measures.tip_phase_deg = pair.map(|(tip, volts)| phase_difference_deg(tip, volts));
        }
        let [times, heights] = &self.ringing;
        let from = self.still_from().map_or(times.len(), |still| times.partition_point(|time| *time < still));
        if let Some(mode) = Mode::of_ringing(&times[from..], &heights[from..]) {
            measures.resonance_hz = Some(mode.resonance_hz);
            measures.damping_ratio = Some(mode.damping_ratio);
            measures.half_power_bandwidth_hz = Some(mode.half_power_bandwidth_hz);
        }
        measures
    }
}

impl Mobile {
    fn take(&mut self, time: f64, nodes: &[[f64; 2]], before: Option<(f64, &[[f64; 2]])>, regular: bool, spacing: f64) {
        let (state, lowest) = contact_state(nodes);
        self.jump_height = self.jump_height.max(lowest);
        let ends = nodes[0][0] + nodes[nodes.len() - 1][0];
        if let Some((then, before)) = before {
            let half = 0.5 * (time - then);
            self.lasting[self.state as usize] += half;
            self.lasting[state as usize] += half;
            self.ends[1] = self.ends[1].max(ends);
            self.close = spacing > 0.0 && self.is_close(lowest, ends, nodes, before, 2.0 * spacing / (time - then));
        } else {
            self.ends = [ends; 2];
        }
        self.state = state;
        for start in [&mut self.stride, &mut self.speed].into_iter().flatten() {
            if start.mean_x.is_none() && time >= start.time {
                let between = before.map(|(then, nodes)| ((start.time - then) / (time - then), nodes));
                let now = mean_x(nodes);
                start.mean_x = Some(between.map_or(now, |(share, before)| (1.0 - share) * mean_x(before) + share * now));
            }
        }
        self.close |= spacing > 0.0 && self.begins(time + 1.5 * spacing);
        if let Some(repetition) = &mut self.repetition {
            repetition.take(before, (time, nodes));
        }
        if !regular {
            return;
        }
        if let Some(of_heights) = &mut self.harmonics {
            // Of an even number of nodes the two in the middle stand for it.
            let z = |node: usize| mm_from_cm(nodes[node][1]);
            let last = nodes.len() - 1;
            of_heights.push(time, [0.5 * (z(last / 2) + z(nodes.len() / 2)), 0.5 * (z(0) + z(last))]);
        }
    }

    /// Whether an extreme is within `ahead` times what was moved since the sample before.
    fn is_close(&self, lowest: f64, ends: f64, nodes: &[[f64; 2]], before: &[[f64; 2]], ahead: f64) -> bool {
        let last = nodes.len() - 1;
        let ends_reach = ahead * (ends - before[0][0] - before[last][0]).abs();
        if ends_reach > NEGLIGIBLE && ends + ends_reach > self.ends[1] {
            return true;
        }
        // Only a node at the height of the lowest can carry it up; the fastest of all is more than that.
        let moved = nodes.iter().zip(before).fold(0.0, |most: f64, (now, before)| {
            let by = (now[1] - before[1]).abs();
            if by > most { by } else { most }
        });
        let reach = ahead * moved;
        reach > NEGLIGIBLE && lowest + reach > self.jump_height
    }

    /// Whether travel begins to be counted by `then` (s) and has not yet begun.
    fn begins(&self, then: f64) -> bool {
        [&self.stride, &self.speed].into_iter().flatten().any(|start| start.mean_x.is_none() && start.time <= then)
    }

    fn measures(&self, plan: &SamplingPlan, nodes: &[[f64; 2]], time: f64, ended: bool) -> Measures {
        let travel = |start: &Start| Some((mm_from_cm(mean_x(nodes) - start.mean_x?), time - start.time));
        let mut measures = Measures {
            jump_height_mm: Some(mm_from_cm(self.jump_height)),
            displacement_sum_mm: Some(mm_from_cm(self.ends[1] - self.ends[0])),
            ..Measures::default()
        };
        if plan.mount == Mount::Ground {
            let [body, end, aerial] = self.lasting.map(|lasting| Some(lasting / (time - plan.first)));
            (measures.body_touching, measures.end_touching, measures.aerial) = (body, end, aerial);
        }
        if plan.period.is_some() && !ended {
            return measures;
        }
        measures.speed_mm_s = self.speed.as_ref().and_then(travel).map(|(by, lasting)| by / lasting);
        measures.stride_mm = self.stride.as_ref().and_then(travel).map(|(by, _)| by);
        if let Some(heights) = &self.harmonics {
            let [middle, ends] = heights.phases_deg();
            measures.mid_end_phase_deg = middle.zip(ends).map(|(middle, ends)| phase_difference_deg(middle, ends));
        }
        measures.period_ratio = self.repetition.as_ref().filter(|repetition| repetition.is_complete()).map(|repetition| {
            let same = |periods: usize| repetition.of(periods).is_some_and(|r| r < SAME);
            if same(1) {
                1.0
            } else if same(2) {
                2.0
            } else {
                0.0
            }
        });
        measures
    }
}

fn mean_x(nodes: &[[f64; 2]]) -> f64 {
    nodes.iter().map(|[x, _]| x).sum::<f64>() / nodes.len() as f64
}
