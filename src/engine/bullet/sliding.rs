//! Friction that depends on the sliding speed.

use super::add;
use crate::bullet::{LinkState, Wrench};
use crate::engine::LARGEST_FRICTION;
use crate::model::{FrictionCurve, Mount, Robot, StickSlip, VISCOUS_REACH};

/// One coefficient per body, as Bullet has one per collider: at the sliding speed of its lowest edge, where viscous friction acts too.
pub(super) struct Sliding {
    law: StickSlip,
    curve: FrictionCurve,
    plain: Vec<f64>,
    half_lengths: Vec<f64>,
    half_thickness: f64,
    frictions: Vec<f64>,
}

impl Sliding {
    /// `None` if friction does not depend on speed.
    pub(super) fn new(robot: &Robot) -> Option<Self> {
        let law = robot.extensions.stick_slip;
        if !robot.extensions.has_friction_of_speed() || robot.mount != Mount::Ground {
            return None;
        }
        let segments = robot.segments();
        let plain: Vec<f64> =
            segments.iter().map(|segment| (segment.friction * robot.friction.ground).min(LARGEST_FRICTION)).collect();
        Some(Self {
            law,
            curve: robot.extensions.friction_of_speed,
            half_lengths: segments.iter().map(|segment| 0.5 * segment.length).collect(),
            half_thickness: 0.5 * robot.collision_thickness,
            frictions: plain.clone(),
            plain,
        })
    }

    /// Coefficient of body `i` on the floor that does not depend on speed.
    pub(super) fn plain(&self, i: usize) -> f64 {
        self.plain[i]
    }

    /// Depth of a box's lowest edge below its centre (cm), and that edge's velocity along x (cm/s).
    fn edge(&self, i: usize, body: &LinkState) -> (f64, f64) {
        let [_, _, [along, _, up]] = body.rotation;
        let below = self.half_lengths[i] * along.abs() + self.half_thickness * up.abs();
        (below, body.velocity[0] - body.angular_velocity[1] * below)
    }

    /// Coefficients for the coming step, at the motions of `boxes`.
    pub(super) fn frictions(&mut self, boxes: &[LinkState]) -> &[f64] {
        for (i, body) in boxes.iter().enumerate() {
            let (_, speed) = self.edge(i, body);
            self.frictions[i] = self.curve.friction(self.law.friction(self.plain[i], speed), speed).min(LARGEST_FRICTION);
        }
        &self.frictions
    }

    /// Adds viscous friction to `wrenches`.
    pub(super) fn push(&self, boxes: &[LinkState], wrenches: &mut [Wrench]) {
        for (i, (body, wrench)) in boxes.iter().zip(wrenches).enumerate() {
            let (below, speed) = self.edge(i, body);
            // The floor is half a thickness below z = 0.
            if body.position[2] - below + self.half_thickness < VISCOUS_REACH {
                let force = -self.law.viscous * speed;
                add(&mut wrench.force, [force, 0.0, 0.0]);
                add(&mut wrench.torque, [0.0, -below * force, 0.0]);
            }
        }
    }
}
