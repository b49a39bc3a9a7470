//! Drag of the sheet in air.

use super::add;
use crate::bullet::{LinkState, Wrench};
use crate::engine::GAUSS;
use crate::model::{Extensions, Robot};

/// Drag of every body: `f = −½·ρ·w·v·(C₁ v₀ + C₂ |v| + C₃ v²/v₀)` per length, v normal to the body.
pub(super) struct Air {
    extensions: Extensions,
    width: f64,
    half_lengths: Vec<f64>,
}

impl Air {
    /// `None` without drag.
    pub(super) fn new(robot: &Robot) -> Option<Self> {
        let half_lengths = robot.segments().iter().map(|segment| 0.5 * segment.length).collect();
        robot.extensions.has_drag().then(|| Self {
            extensions: robot.extensions.clone(),
            width: robot.material.width,
            half_lengths,
        })
    }

    /// Adds the drag on boxes with these motions to `wrenches`.
    pub(super) fn push(&self, boxes: &[LinkState], wrenches: &mut [Wrench]) {
        for ((body, half), wrench) in boxes.iter().zip(&self.half_lengths).zip(wrenches) {
            let axis = |k: usize| body.rotation.map(|row| row[k]);
            let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            let (across, normal) = (axis(1), axis(2));
            let (mut force, mut moment) = (0.0, 0.0);
            for (at, weight) in GAUSS {
                let arm = at * half;
                // A positive turn lowers the far end.
                let speed = dot(body.velocity, normal) - arm * dot(body.angular_velocity, across);
                let part = -self.extensions.drag_per_speed(self.width, speed) * weight * half * speed;
                force += part;
                moment -= arm * part;
            }
            add(&mut wrench.force, normal.map(|n| n * force));
            add(&mut wrench.torque, across.map(|a| a * moment));
        }
    }
}
