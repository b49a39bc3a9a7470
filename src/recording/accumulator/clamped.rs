//! The measures of a clamped robot: height, phase and ringing of its tip.

use super::super::measures::Measures;
use super::super::signal::{HarmonicSums, Mode, parabola_top, phase_difference_deg};
use super::SamplingPlan;
use crate::model::units::mm_from_cm;

/// Largest number of samples kept of a ringing tip: the first two thousand periods of the first mode at a run's spacing.
const RINGING: usize = 1 << 20;
/// Largest number of values that these samples and their voltages may have (128 MB).
const RINGING_VALUES: usize = 1 << 24;
/// Voltages within this share of their travel from the last one count as constant: 5 % of creep after a step does.
const STILL: f64 = 0.1;

/// Sums over the samples of a clamped robot.
#[derive(Debug)]
pub(super) struct Clamped {
    /// Height of the tip (mm) in the last sample, and its extremes.
    tip: f64,
    low: f64,
    high: f64,
    /// Time from which `low` and `high` are taken (s).
    from: f64,
    /// Harmonics of the tip's height and of the first actuator's voltage.
    harmonics: Option<[HarmonicSums<1>; 2]>,
    /// Times (s) and heights (mm) for the free decay.
    ringing: [Vec<f64>; 2],
    /// Times (s) and joint voltages (V), row after row, of the same samples.
    voltages: [Vec<f64>; 2],
    /// Times (s) and heights (mm) of the last two samples.
    last: [(f64, f64); 2],
}

impl Clamped {
    /// Empty sums.
    pub(super) fn new(plan: &SamplingPlan) -> Self {
        let period = plan.period;
        let half = period.and_then(|period| Some((plan.resolved_half(period)?, period)));
        let rings = if period.is_none() { plan.samples.min(RINGING).min(RINGING_VALUES / (plan.nodes + 1)) } else { 0 };
        Self {
            tip: 0.0,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            from: period.and_then(|period| plan.periods_before_end(period, 1.0)).unwrap_or(plan.first),
            harmonics: half.map(|(from, period)| [(); 2].map(|()| HarmonicSums::new(1.0 / period, from))),
            ringing: [Vec::with_capacity(rings), Vec::with_capacity(rings)],
            voltages: [Vec::with_capacity(rings), Vec::with_capacity(rings * (plan.nodes - 2))],
            last: [(f64::NAN, f64::NAN); 2],
        }
    }

    /// Takes the joint voltages (V) at `time` (s).
    pub(super) fn voltages(&mut self, time: f64, volts: &[f64]) {
        if let Some([_, of_volts]) = &mut self.harmonics {
            of_volts.push(time, [volts.first().copied().unwrap_or(0.0)]);
        }
        let [times, all] = &mut self.voltages;
        if times.len() < times.capacity() {
            times.push(time);
            all.extend_from_slice(volts);
        }
    }

    /// Takes the nodes' x and z (cm) at `time` (s).
    pub(super) fn take(&mut self, time: f64, nodes: &[[f64; 2]]) {
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

    /// Time from which all voltages stay within [`STILL`] of their last value (s): motion after it is free, motion before it driven.
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

    /// The measures; without those of a period if the motion has not `ended`.
    pub(super) fn measures(&self, plan: &SamplingPlan, ended: bool) -> Measures {
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
