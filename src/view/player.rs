//! A recording as a self-contained HTML page that plays it.

use serde_json::json;

use super::text::escape;
use crate::model::units::mm_from_cm;
use crate::recording::Recording;

/// Frames that a page holds at most.
const FRAMES: usize = 2000;
/// Speeds that the page offers, beside one that was wished for.
const SPEEDS: [f64; 8] = [0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.0];
/// How long a recording should take to play (s), to choose the speed it begins with.
const WATCH: f64 = 8.0;

/// Voltages of the actuators in one record (V).
pub(super) fn voltages(recording: &Recording, record: usize) -> Vec<f64> {
    let (joints, m) = (recording.joints(), recording.meta.motors_per_actuator);
    (0..recording.meta.actuators).map(|a| recording.motor_voltages[record * joints + a * m] * m as f64).collect()
}

/// Whether the robot lies on the floor: files of the reference say so by their keys, others by never going below it.
pub(super) fn on_ground(recording: &Recording) -> bool {
    recording.meta.ground.is_some()
}

/// The page, which plays at `speed` (1: real time) at first, or at one that takes some seconds.
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
    // Numbers only, so the text cannot end the script element.
    include_str!("player.html").replace("@TITLE@", &escape(title)).replace("@DATA@", &data.to_string())
}
