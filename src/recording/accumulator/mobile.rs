//! The measures of a robot on the ground or free: heights, contact, travel and repetition.

use super::super::measures::{ContactState, Measures, contact_state};
use super::super::signal::{HarmonicSums, Repetition, phase_difference_deg};
use super::SamplingPlan;
use crate::model::Mount;
use crate::model::units::mm_from_cm;

/// Largest [`Repetition::of`] that counts as a repeated motion: at 14 Hz it is below 0.1 after two periods and 0.6 after one.
const SAME: f64 = 0.2;
/// Error of an extreme that is neglected (cm).
const NEGLIGIBLE: f64 = 1e-4;

/// Sums over the samples of a robot that is not clamped.
#[derive(Debug)]
pub(super) struct Mobile {
    /// Largest height of the lowest node (cm).
    jump_height: f64,
    /// Sum of both ends' x in the first sample, and the largest since (cm).
    ends: [f64; 2],
    /// Time in each contact state (s).
    lasting: [f64; 3],
    /// Contact state of the last sample.
    state: ContactState,
    /// True if the next step might be an extreme.
    pub(super) close: bool,
    /// Starts of the travel over the last period and over the last half of the run.
    stride: Option<Start>,
    speed: Option<Start>,
    /// Harmonics of the heights of the middle and of both ends.
    harmonics: Option<HarmonicSums<2>>,
    repetition: Option<Repetition>,
}

/// Start of a travel.
#[derive(Debug, Clone, Copy)]
struct Start {
    /// Time from which travel is counted (s).
    time: f64,
    /// Mean x of the nodes then (cm); `None` before.
    mean_x: Option<f64>,
}

impl Mobile {
    /// Empty sums.
    pub(super) fn new(plan: &SamplingPlan) -> Self {
        let period = plan.period;
        let half = period.and_then(|period| Some((plan.resolved_half(period)?, period)));
        let begin = |time: f64| Start { time, mean_x: None };
        Self {
            jump_height: f64::NEG_INFINITY,
            ends: [0.0; 2],
            lasting: [0.0; 3],
            state: ContactState::Aerial,
            close: false,
            stride: period.and_then(|period| plan.periods_before_end(period, 1.0)).map(begin),
            speed: if let Some(period) = period { plan.half(period).map(begin) } else { Some(begin(plan.first)) },
            harmonics: half.map(|(from, period)| HarmonicSums::new(1.0 / period, from)),
            repetition: period.and_then(|period| plan.repetition(period)),
        }
    }

    /// Takes the nodes' x and z (cm) at `time` (s), after those of the previous sample with its time. Harmonics take `regular` samples only.
    pub(super) fn take(
        &mut self,
        time: f64,
        nodes: &[[f64; 2]],
        before: Option<(f64, &[[f64; 2]])>,
        regular: bool,
        spacing: f64,
    ) {
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
            // The middle of an even number of nodes is the mean of two.
            let z = |node: usize| mm_from_cm(nodes[node][1]);
            let last = nodes.len() - 1;
            of_heights.push(time, [0.5 * (z(last / 2) + z(nodes.len() / 2)), 0.5 * (z(0) + z(last))]);
        }
    }

    /// True if an extreme is within `ahead` times the motion since the previous sample.
    fn is_close(&self, lowest: f64, ends: f64, nodes: &[[f64; 2]], before: &[[f64; 2]], ahead: f64) -> bool {
        let last = nodes.len() - 1;
        let ends_reach = ahead * (ends - before[0][0] - before[last][0]).abs();
        if ends_reach > NEGLIGIBLE && ends + ends_reach > self.ends[1] {
            return true;
        }
        // The speed of the fastest node bounds that of the lowest.
        let moved = nodes.iter().zip(before).fold(0.0, |most: f64, (now, before)| {
            let by = (now[1] - before[1]).abs();
            if by > most { by } else { most }
        });
        let reach = ahead * moved;
        reach > NEGLIGIBLE && lowest + reach > self.jump_height
    }

    /// True if travel is still to be counted from a time before `then` (s).
    fn begins(&self, then: f64) -> bool {
        [&self.stride, &self.speed].into_iter().flatten().any(|start| start.mean_x.is_none() && start.time <= then)
    }

    /// The measures; without those of a period if the motion has not `ended`.
    pub(super) fn measures(&self, plan: &SamplingPlan, nodes: &[[f64; 2]], time: f64, ended: bool) -> Measures {
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
