//! Measures of a motion, with units in their names.

use serde::Serialize;

use super::Recording;
use crate::model::units::mm_from_cm;

/// Clearance below which a node touches the floor (cm): well above the 10⁻⁴ cm of resting contact.
const TOUCHING: f64 = 0.005;

/// Measures of one run; those that do not apply to its mount or drive are absent.
///
/// A run computes them from selected steps, every step near an extreme (to 0.001 mm), so that they do not depend on the record interval; only those
/// named `recorded` do. The state at the start of a period is interpolated linearly between steps.
///
/// "The last period" is the last whole period of the drive; measures of the settled state use the last half of the run in whole periods. x and z
/// are those of the nodes.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Measures {
    /// Height of the right end above the flat robot in the last record (mm), z of the last node. Clamped robots.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip_deflection_mm: Option<f64>,
    /// Half the difference between the largest and smallest height of the right end over the last period, or over the whole run of a
    /// drive without a period (mm). Clamped robots.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip_amplitude_mm: Option<f64>,
    /// Phase of the right end's height against the voltage of the first actuator, both at the drive's frequency over the last half of
    /// the run (deg): 0 for slow drives, negative for a lag. Clamped robots with a period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip_phase_deg: Option<f64>,
    /// Frequency of the largest response (Hz), from the ringing of the right end after the last change of voltage: see
    /// [`Mode::of_ringing`](super::signal::Mode::of_ringing). Clamped robots, drives without a period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resonance_hz: Option<f64>,
    /// Damping ratio of that mode (–).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damping_ratio: Option<f64>,
    /// Width of its peak at 1/√2 of the height (Hz).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_power_bandwidth_hz: Option<f64>,
    /// Largest height of the lowest point: max over time of min over nodes of z (mm). Robots that are not clamped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jump_height_mm: Option<f64>,
    /// Jump height of the records alone, which may miss the peak (mm), as in the authors' curves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recorded_jump_height_mm: Option<f64>,
    /// Travel of the nodes' mean x during the last period (mm). Robots that are not clamped, with a period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stride_mm: Option<f64>,
    /// Mean speed of the nodes' mean x over the last half of the run in whole periods, or over the whole run if the drive has no
    /// period (mm/s). Robots that are not clamped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_mm_s: Option<f64>,
    /// Max over time of the left end's plus the right end's travel along x (mm). Robots that are not clamped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub displacement_sum_mm: Option<f64>,
    /// Periods of the drive after which the nodes' heights repeat, by [`Repetition`](super::signal::Repetition) below 0.2 over the last half of the run in pairs of
    /// periods: 1, 2, or 0 for neither (–). Robots that are not clamped, with a period, in runs of six periods or more.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_ratio: Option<f64>,
    /// Phase of the middle node's height against the mean height of both ends, at the drive's frequency over the last half of the run
    /// (deg). Robots that are not clamped, with a period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mid_end_phase_deg: Option<f64>,
    /// Share of the time that a node other than the ends touches the floor (–): see [`contact_states`]. Robots on the ground.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body_touching: Option<f64>,
    /// Share of the time that only the ends touch (–).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end_touching: Option<f64>,
    /// Share of the time that nothing touches (–).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aerial: Option<f64>,
    /// Energy that nothing supplied, as a fraction of the largest mechanical energy (–): see
    /// [`EnergyBalance`](crate::engine::EnergyBalance). Known to the run, not to the recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy_error: Option<f64>,
}

/// Contact of a robot with the floor at one time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactState {
    /// A node other than the two at each end touches.
    BodyTouching,
    /// Only the ends touch: the last node or the joint next to it.
    EndTouching,
    /// Nothing touches.
    Aerial,
}

/// Contact state in each record. A node touches if it is less than 0.05 mm above its height on the flat robot.
pub fn contact_states(recording: &Recording) -> Vec<ContactState> {
    let mut nodes = vec![[0.0; 2]; recording.nodes()];
    let state = |record| {
        copy_nodes(recording, record, &mut nodes);
        contact_state(&nodes).0
    };
    (0..recording.len()).map(state).collect()
}

/// Contact state of nodes at x, z (cm), and the height of the lowest node (cm).
pub(super) fn contact_state(nodes: &[[f64; 2]]) -> (ContactState, f64) {
    let lowest = |nodes: &[[f64; 2]]| nodes.iter().fold(f64::INFINITY, |low, &[_, z]| if z < low { z } else { low });
    let inner = 2..nodes.len().saturating_sub(2);
    let body = nodes.get(inner.clone()).map_or(f64::INFINITY, lowest);
    let ends = lowest(&nodes[..2.min(nodes.len())]).min(lowest(&nodes[inner.end..]));
    let state = if body < TOUCHING {
        ContactState::BodyTouching
    } else if ends < TOUCHING {
        ContactState::EndTouching
    } else {
        ContactState::Aerial
    };
    (state, body.min(ends))
}

/// Copies x and z (cm) of the nodes in a record.
pub(super) fn copy_nodes(recording: &Recording, record: usize, to: &mut [[f64; 2]]) {
    for (node, to) in to.iter_mut().enumerate() {
        let [x, _, z] = recording.node(record, node);
        *to = [x, z];
    }
}

/// Largest height (mm) of the lowest node in the records.
pub(crate) fn recorded_jump_height(recording: &Recording) -> f64 {
    let z = |record: usize, node: usize| recording.node(record, node)[2];
    let lowest = |record: usize| (0..recording.nodes()).map(|node| z(record, node)).fold(f64::INFINITY, f64::min);
    mm_from_cm((0..recording.len()).map(lowest).fold(f64::NEG_INFINITY, f64::max))
}

impl Measures {
    /// Names and values of the measures that are present.
    pub fn named(&self) -> Vec<(String, f64)> {
        let Ok(serde_json::Value::Object(fields)) = serde_json::to_value(self) else { return Vec::new() };
        fields.into_iter().filter_map(|(name, value)| Some((name, value.as_f64()?))).collect()
    }

    /// The value of one measure, if it is present.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.named().into_iter().find(|(found, _)| found == name).map(|(_, value)| value)
    }

    /// The names of all measures.
    pub fn names() -> Vec<String> {
        let full = Self {
            tip_deflection_mm: Some(0.0),
            tip_amplitude_mm: Some(0.0),
            tip_phase_deg: Some(0.0),
            resonance_hz: Some(0.0),
            damping_ratio: Some(0.0),
            half_power_bandwidth_hz: Some(0.0),
            jump_height_mm: Some(0.0),
            recorded_jump_height_mm: Some(0.0),
            stride_mm: Some(0.0),
            speed_mm_s: Some(0.0),
            displacement_sum_mm: Some(0.0),
            period_ratio: Some(0.0),
            mid_end_phase_deg: Some(0.0),
            body_touching: Some(0.0),
            end_touching: Some(0.0),
            aerial: Some(0.0),
            energy_error: Some(0.0),
        };
        full.named().into_iter().map(|(name, _)| name).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Meta;
    use super::*;
    use crate::model::Mount;
    use std::f64::consts::PI;

    /// A robot of one actuator with `m` joints whose nodes move as `(x, z)` (cm) of node and time, on 1 V − cos.
    fn recording(times: &[f64], m: usize, frequency: f64, node: impl Fn(usize, f64) -> (f64, f64)) -> Recording {
        let mut recording = Recording {
            meta: Meta { actuators: 1, motors_per_actuator: m, ..Meta::default() },
            time: times.to_vec(),
            ..Recording::default()
        };
        for &t in times {
            recording.positions.extend((0..m + 2).map(|i| node(i, t)).flat_map(|(x, z)| [x, 0.0, z]));
            recording.motor_voltages.extend(vec![-(1.0 - (2.0 * PI * frequency * t).cos()); m]);
        }
        recording
    }

    fn times() -> Vec<f64> {
        (0..=2000).map(|i| f64::from(i) * 1e-3).collect()
    }

    #[test]
    fn a_tip_that_swings_has_its_amplitude_last_deflection_and_phase() {
        // The voltage is −1 + cos: its harmonic leads with phase 0, the tip's lags by 0.9 rad.
        let tip = |i: usize, t: f64| (0.0, if i == 2 { -0.5 + 0.2 * (2.0 * PI * 2.0 * t - 0.9).cos() } else { 0.0 });
        let measures = Measures::of(&recording(&times(), 1, 2.0, tip), Mount::Clamped, Some(0.5));
        // Half the sampling step away from the extreme: 2 mm (ωΔt/2)²/2.
        assert!((measures.tip_amplitude_mm.unwrap() - 2.0).abs() < 1e-4);
        assert!((measures.tip_deflection_mm.unwrap() - (-5.0 + 2.0 * 0.9_f64.cos())).abs() < 1e-9);
        assert!((measures.tip_phase_deg.unwrap() + 0.9_f64.to_degrees()).abs() < 1e-9);
        assert_eq!((measures.jump_height_mm, measures.resonance_hz), (None, None));
    }

    #[test]
    fn a_tip_that_rings_has_a_resonance() {
        let tip = |i: usize, t: f64| (0.0, if i == 2 { -1.0 + (-4.0 * t).exp() * (2.0 * PI * 10.0 * t).cos() } else { 0.0 });
        let mut left_alone = recording(&times(), 1, 1.0, tip);
        left_alone.motor_voltages.fill(-1.0);
        let measures = Measures::of(&left_alone, Mount::Clamped, None);
        let zeta = 4.0 / (4.0_f64.powi(2) + (2.0 * PI * 10.0).powi(2)).sqrt();
        assert!((measures.damping_ratio.unwrap() / zeta - 1.0).abs() < 2e-3);
        assert!((measures.resonance_hz.unwrap() - 10.0).abs() < 0.06);
        assert_eq!(measures.tip_phase_deg, None);
    }

    #[test]
    fn a_driven_tip_does_not_ring_and_one_that_is_left_alone_does() {
        // As driven by a file, which has no period.
        let tip =
            |i: usize, t: f64| (0.0, if i == 2 { (1.0 + 0.2 * (-2.0 * t).exp()) * (2.0 * PI * 10.0 * t).cos() } else { 0.0 });
        let mut driven = recording(&times(), 1, 10.0, tip);
        let measures = Measures::of(&driven, Mount::Clamped, None);
        assert_eq!((measures.damping_ratio, measures.resonance_hz, measures.half_power_bandwidth_hz), (None, None, None));
        assert!(measures.tip_amplitude_mm.is_some());
        // The voltage stops at half a second, then the tip rings.
        let ring = |i: usize, t: f64| {
            let after = (t - 0.5).max(0.0);
            (0.0, if i == 2 { (-4.0 * after).exp() * (2.0 * PI * 10.0 * t).cos() } else { 0.0 })
        };
        driven = recording(&times(), 1, 10.0, ring);
        for (record, t) in times().iter().enumerate().filter(|(_, t)| **t > 0.5) {
            driven.motor_voltages[record] = if *t > 0.0 { -2.0 } else { 0.0 };
        }
        let zeta = 4.0 / (4.0_f64.powi(2) + (2.0 * PI * 10.0).powi(2)).sqrt();
        assert!((Measures::of(&driven, Mount::Clamped, None).damping_ratio.unwrap() / zeta - 1.0).abs() < 5e-3);
    }

    #[test]
    fn a_robot_that_flies_and_drifts_has_height_stride_and_speed() {
        // Left end up to 3 mm, right end up to 4 mm, at the same time; 7 mm/s to the right.
        let hump = |t: f64| (1.0 - (2.0 * t - 1.0).powi(2)).max(0.0);
        let node = |i: usize, t: f64| (5.0 * i as f64 + 0.7 * t, (0.3 + 0.05 * i as f64) * hump(t));
        let robot = recording(&times(), 1, 4.0, node);
        let measures = Measures::of(&robot, Mount::Ground, Some(0.25));
        assert!((measures.jump_height_mm.unwrap() - 3.0).abs() < 1e-9);
        assert!((measures.stride_mm.unwrap() - 1.75).abs() < 1e-9);
        assert!((measures.speed_mm_s.unwrap() - 7.0).abs() < 1e-9);
        assert!((measures.displacement_sum_mm.unwrap() - 28.0).abs() < 1e-9);
        let aperiodic = Measures::of(&robot, Mount::Ground, None);
        assert_eq!(aperiodic.stride_mm, None);
        assert!((aperiodic.speed_mm_s.unwrap() - 7.0).abs() < 1e-9);
        // 0.05 mm is passed where 1 − (2t − 1)² = 0.005/0.3, at 0.42 % and 99.6 % of the first second; the next second it lies.
        assert!((measures.aerial.unwrap() - 0.496).abs() < 2e-3, "{measures:?}");
    }

    #[test]
    fn a_motion_of_twice_the_period_is_told_from_one_of_the_same_and_from_none() {
        let with = |extra: fn(f64) -> f64| {
            let node = move |i: usize, t: f64| {
                let sign = if i == 2 || i == 3 { -1.0 } else { 1.0 };
                (i as f64, 1.0 + sign * 0.1 * (2.0 * PI * 10.0 * t).cos() + 0.1 * extra(t))
            };
            Measures::of(&recording(&times(), 4, 10.0, node), Mount::Ground, Some(0.1))
        };
        let same = with(|_| 0.0);
        assert_eq!(same.period_ratio, Some(1.0));
        assert!((same.mid_end_phase_deg.unwrap().abs() - 180.0).abs() < 1e-6);
        assert_eq!(with(|t| (2.0 * PI * 5.0 * t).cos()).period_ratio, Some(2.0));
        assert_eq!(with(|t| (2.0 * PI * 7.1 * t).cos()).period_ratio, Some(0.0));
    }

    #[test]
    fn contact_is_by_the_body_by_the_ends_or_not_at_all() {
        let flat = |_: usize, _: f64| (0.0, 0.0);
        let arch = |i: usize, _: f64| (0.0, if i == 0 || i == 7 { 0.0 } else { 1.0 });
        let high = |_: usize, _: f64| (0.0, 1.0);
        let state = |node: fn(usize, f64) -> (f64, f64)| contact_states(&recording(&[0.0, 1.0], 6, 1.0, node))[0];
        assert_eq!(state(flat), ContactState::BodyTouching);
        assert_eq!(state(arch), ContactState::EndTouching);
        assert_eq!(state(high), ContactState::Aerial);
    }

    /// 500 Hz seen a thousand times a second is aliased; 10¹² Hz kept the comparison of periods busy for ever.
    #[test]
    fn a_period_that_the_records_do_not_follow_has_no_phases_and_no_ratio() {
        let node = |i: usize, t: f64| (i as f64, 1.0 + 0.1 * (2.0 * PI * 10.0 * t).cos());
        for period in [2e-3, 1e-12] {
            let ground = Measures::of(&recording(&times(), 4, 10.0, node), Mount::Ground, Some(period));
            assert_eq!((ground.period_ratio, ground.mid_end_phase_deg), (None, None), "{period}");
            let clamped = Measures::of(&recording(&times(), 4, 10.0, node), Mount::Clamped, Some(period));
            assert_eq!(clamped.tip_phase_deg, None, "{period}");
        }
    }

    #[test]
    fn a_run_shorter_than_a_period_has_no_stride_and_an_empty_one_no_measures() {
        let robot = recording(&times(), 1, 1.0, |i, _| (i as f64, 0.0));
        let measures = Measures::of(&robot, Mount::Ground, Some(3.0));
        assert_eq!((measures.stride_mm, measures.speed_mm_s), (None, None));
        assert_eq!(Measures::of(&Recording::default(), Mount::Ground, None), Measures::default());
    }

    #[test]
    fn every_measure_can_be_asked_for_by_its_name() {
        let names = Measures::names();
        assert_eq!(names.len(), 17);
        let measures = Measures { stride_mm: Some(2.5), ..Measures::default() };
        assert_eq!((measures.get("stride_mm"), measures.get("aerial")), (Some(2.5), None));
    }
}
