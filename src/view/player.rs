//! Self-contained HTML pages that play recordings.

use serde_json::json;

use super::text::escape;
use crate::model::units::mm_from_cm;
use crate::recording::Recording;

/// Largest number of frames of a page.
const FRAMES: usize = 2000;
/// Speeds of the page (1: real time), besides a requested one.
const SPEEDS: [f64; 8] = [0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.0];
/// Duration of playback at the initial speed (s).
const WATCH: f64 = 8.0;

/// Voltages of the actuators in a record (V).
pub(super) fn voltages(recording: &Recording, record: usize) -> Vec<f64> {
    let (joints, m) = (recording.joints(), recording.meta.motors_per_actuator);
    (0..recording.meta.actuators).map(|a| recording.motor_voltages[record * joints + a * m] * m as f64).collect()
}

/// True if the robot is on the ground.
pub(super) fn on_ground(recording: &Recording) -> bool {
    recording.meta.ground.is_some()
}

/// The page, with initial speed `speed` (1: real time; by default a duration of about eight seconds).
pub fn player(title: &str, recording: &Recording, speed: Option<f64>) -> String {
    let round = |value: f64, to: f64| (value * to).round() / to;
    let stride = recording.len().div_ceil(FRAMES).max(1);
    let records = || (0..recording.len()).step_by(stride);
    let nodes: Vec<Vec<f64>> = records()
        .map(|r| {
            (0..recording.nodes())
                .map(|n| recording.node(r, n))
                .flat_map(|[x, _, z]| [x, z].map(|v| round(mm_from_cm(v), 1e3)))
                .collect()
        })
        .collect();
    let duration = recording.time.last().copied().unwrap_or(0.0);
    let wanted = duration / WATCH;
    let nearest = SPEEDS.into_iter().min_by(|a, b| (a / wanted).ln().abs().total_cmp(&(b / wanted).ln().abs())).unwrap_or(1.0);
    let data = json!({
        "actuators": recording.meta.actuators,
        "m": recording.meta.motors_per_actuator,
        "ground": on_ground(recording),
        "speed": speed.unwrap_or(nearest),
        "time": records().map(|r| round(recording.time[r], 1e7)).collect::<Vec<_>>(),
        "nodes": nodes,
        "volts": records().map(|r| voltages(recording, r).into_iter().map(|v| round(v, 10.0)).collect::<Vec<_>>()).collect::<Vec<_>>(),
    });
    // Only numbers, so the data cannot end the script element.
    include_str!("player.html").replace("@TITLE@", &escape(title)).replace("@DATA@", &data.to_string())
}
