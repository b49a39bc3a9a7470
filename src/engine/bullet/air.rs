//! Drag of the sheet in air.

use super::add;
use crate::bullet::{LinkState, Wrench};
use crate::engine::GAUSS;
use crate::model::{AIR_DENSITY, Robot};

/// Drag of every body: `f = −½·ρ·C_d·w·v·|v|` per length, v normal to the body.
pub(super) struct Air {
    /// ½ ρ C_d w (g/cm²).
    drag: f64,
    half_lengths: Vec<f64>,
}

impl Air {
    /// `None` without drag.
    pub(super) fn new(robot: &Robot) -> Option<Self> {
        let drag = 0.5 * AIR_DENSITY * robot.extensions.drag * robot.material.width;
        let half_lengths = robot.segments().iter().map(|segment| 0.5 * segment.length).collect();
        (drag != 0.0).then_some(Self { drag, half_lengths })
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
                let part = -self.drag * weight * half * speed * speed.abs();
                force += part;
                moment -= arm * part;
            }
            add(&mut wrench.force, normal.map(|n| n * force));
            add(&mut wrench.torque, across.map(|a| a * moment));
        }
    }
}
