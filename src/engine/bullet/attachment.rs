//! Tapes and cables at the sheet.

use super::add;
use crate::bullet::{LinkState, Wrench};
use crate::model::{Attachment, Robot};

/// Vertical forces at points of the bodies, with their heights and velocities at a step's start.
pub(super) struct Attachments {
    /// The law, the body, and the point's distance from the box's centre along the body (cm).
    points: Vec<(Attachment, usize, f64)>,
    time_step: f64,
}

impl Attachments {
    /// `None` where nothing is fixed to the robot.
    pub(super) fn new(robot: &Robot, time_step: f64) -> Option<Self> {
        let segments = robot.segments();
        let point = |law: &Attachment| {
            let (body, share) = robot.body_at(law.position);
            (*law, body, (share - 0.5) * segments[body].length)
        };
        let points: Vec<_> = robot.extensions.attachments.iter().map(point).collect();
        (!points.is_empty()).then_some(Self { points, time_step })
    }

    /// Adds the forces on boxes with these motions to `wrenches`.
    pub(super) fn push(&self, boxes: &[LinkState], wrenches: &mut [Wrench]) {
        for (law, index, arm) in &self.points {
            let body = &boxes[*index];
            let [x, _, z] = body.rotation.map(|row| arm * row[0]);
            // A positive turn lowers the far end.
            let speed = body.velocity[2] - body.angular_velocity[1] * x;
            // Links stand where they were a step ago, the base stands where it is.
            let late = if *index > 0 { self.time_step } else { 0.0 };
            let height = body.position[2] + z + late * speed;
            let force = law.spring(height)[0] - law.resistance(height, speed)[0];
            let wrench = &mut wrenches[*index];
            add(&mut wrench.force, [0.0, 0.0, force]);
            add(&mut wrench.torque, [0.0, -x * force, 0.0]);
        }
    }
}
