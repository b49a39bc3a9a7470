//! Numbers that a recording is judged by. Each carries its unit in its name.

use serde::Serialize;

use super::Recording;
use crate::model::Mount;
use crate::model::units::mm_from_cm;

/// Measures of one run; those that make no sense for its mount or drive are absent.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Measures {
    /// Height of the right end above the flat robot in the last record (mm): z of the last node. Clamped robots.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip_deflection_mm: Option<f64>,
    /// Half the difference between the largest and smallest height of the right end over the last whole period of the drive, or over
    /// the whole run if the drive has none (mm). Clamped robots.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip_amplitude_mm: Option<f64>,
    /// Height of the lowest point at its best: max over time of min over nodes of z (mm). Robots that are not clamped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jump_height_mm: Option<f64>,
    /// Travel of the nodes' mean x during the last whole period (mm). Robots that are not clamped, with a period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stride_mm: Option<f64>,
    /// Mean speed of the nodes' mean x: the stride over its period, or the whole travel over the whole time if the drive has no
    /// period (mm/s). Robots that are not clamped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_mm_s: Option<f64>,
}

impl Measures {
    /// Takes the measures of `recording`. `period` (s) is the drive's, if it repeats.
    pub fn of(recording: &Recording, mount: Mount, period: Option<f64>) -> Self {
        let (Some(&first_time), Some(&last_time)) = (recording.time.first(), recording.time.last()) else {
            return Self::default();
        };
        let last = recording.len() - 1;
        // Index of the record nearest to one period before the end, if the run is that long.
        let period_start = period
            .filter(|&period| period > 0.0 && last_time - period >= first_time - 1e-9 * period)
            .map(|period| nearest(&recording.time, last_time - period))
            .filter(|&start| start < last);
        let mut measures = Self::default();
        if mount == Mount::Clamped {
            let tip = |record: usize| mm_from_cm(recording.node(record, recording.nodes() - 1)[2]);
            let window = period_start.unwrap_or(0)..=last;
            let (low, high) =
                window.map(tip).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (low.min(z), high.max(z)));
            measures.tip_deflection_mm = Some(tip(last));
            measures.tip_amplitude_mm = Some((high - low) / 2.0);
            return measures;
        }
        let lowest =
            |record: usize| (0..recording.nodes()).map(|node| recording.node(record, node)[2]).fold(f64::INFINITY, f64::min);
        let mean_x = |record: usize| {
            (0..recording.nodes()).map(|node| recording.node(record, node)[0]).sum::<f64>() / recording.nodes() as f64
        };
        let travel = |from: usize| mm_from_cm(mean_x(last) - mean_x(from));
        measures.jump_height_mm = Some(mm_from_cm((0..=last).map(lowest).fold(f64::NEG_INFINITY, f64::max)));
        measures.stride_mm = period_start.map(travel);
        let from = period_start.unwrap_or(0);
        if last_time > recording.time[from] {
            measures.speed_mm_s = Some(travel(from) / (last_time - recording.time[from]));
        }
        measures
    }

    /// Name and value of every measure that is present.
    pub fn named(&self) -> Vec<(&'static str, f64)> {
        [
            ("tip_deflection_mm", self.tip_deflection_mm),
            ("tip_amplitude_mm", self.tip_amplitude_mm),
            ("jump_height_mm", self.jump_height_mm),
            ("stride_mm", self.stride_mm),
            ("speed_mm_s", self.speed_mm_s),
        ]
        .into_iter()
        .filter_map(|(name, value)| Some((name, value?)))
        .collect()
    }
}

fn nearest(times: &[f64], t: f64) -> usize {
    let after = times.partition_point(|&time| time < t);
    match after.checked_sub(1) {
        Some(before) if after == times.len() || t - times[before] <= times[after] - t => before,
        _ => after,
    }
}

#[cfg(test)]
mod tests {
    use super::super::Meta;
    use super::*;

    /// Three nodes (two would be a robot without joints), the middle one at the mean of the ends.
    fn recording(times: &[f64], left: impl Fn(f64) -> (f64, f64), right: impl Fn(f64) -> (f64, f64)) -> Recording {
        let mut recording = Recording {
            meta: Meta { actuators: 1, motors_per_actuator: 1, ..Meta::default() },
            time: times.to_vec(),
            ..Recording::default()
        };
        for &t in times {
            let ((xl, zl), (xr, zr)) = (left(t), right(t));
            recording.positions.extend([xl, 0.0, zl, (xl + xr) / 2.0, 0.0, (zl + zr) / 2.0, xr, 0.0, zr]);
        }
        recording
    }

    fn times() -> Vec<f64> {
        (0..=2000).map(|i| f64::from(i) * 1e-3).collect()
    }

    #[test]
    fn a_tip_that_swings_has_its_amplitude_and_last_deflection() {
        let tip = |t: f64| (10.0, -0.5 + 0.2 * (2.0 * std::f64::consts::PI * 2.0 * t).sin());
        let measures = Measures::of(&recording(&times(), |_| (0.0, 0.0), tip), Mount::Clamped, Some(0.5));
        assert!((measures.tip_amplitude_mm.unwrap() - 2.0).abs() < 1e-9);
        assert!((measures.tip_deflection_mm.unwrap() + 5.0).abs() < 1e-9);
        assert_eq!(measures.jump_height_mm, None);
    }

    #[test]
    fn a_robot_that_flies_and_drifts_has_height_stride_and_speed() {
        // Left end up to 3 mm, right end up to 4 mm, at the same time; 7 mm/s to the right.
        let hump = |t: f64| (1.0 - (2.0 * t - 1.0).powi(2)).max(0.0);
        let robot = recording(&times(), |t| (0.7 * t, 0.3 * hump(t)), |t| (10.0 + 0.7 * t, 0.4 * hump(t)));
        let measures = Measures::of(&robot, Mount::Ground, Some(0.25));
        assert!((measures.jump_height_mm.unwrap() - 3.0).abs() < 1e-9);
        assert!((measures.stride_mm.unwrap() - 1.75).abs() < 1e-9);
        assert!((measures.speed_mm_s.unwrap() - 7.0).abs() < 1e-9);
        let aperiodic = Measures::of(&robot, Mount::Ground, None);
        assert_eq!(aperiodic.stride_mm, None);
        assert!((aperiodic.speed_mm_s.unwrap() - 7.0).abs() < 1e-9);
    }

    #[test]
    fn a_run_shorter_than_a_period_has_no_stride_and_an_empty_one_no_measures() {
        let robot = recording(&times(), |_| (0.0, 0.0), |_| (1.0, 0.0));
        assert_eq!(Measures::of(&robot, Mount::Ground, Some(3.0)).stride_mm, None);
        assert_eq!(Measures::of(&Recording::default(), Mount::Ground, None), Measures::default());
    }
}
