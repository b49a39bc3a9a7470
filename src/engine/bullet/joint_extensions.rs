//! Joint torques beyond eq. 1.

use crate::actuator::PiezoJoint;
use crate::model::{Extensions, LOSS_TIMES, Robot};

/// Joint torques beyond eq. 1. Like the torque law they act with the state at a step's start.
pub(super) struct JointExtensions {
    extensions: Extensions,
    pub(super) link: f64,
    /// Rest angle at 0 V of each joint (rad), and factor on its voltage.
    rest_angles: Vec<f64>,
    gains: Vec<f64>,
    /// q_j of each joint's Prony chain (rad).
    pub(super) loss: Vec<[f64; LOSS_TIMES.len()]>,
    /// Largest elastic angle so far (rad), if joints harden with it.
    pub(super) largest: f64,
}

impl JointExtensions {
    /// `None` for the plain model.
    pub(super) fn new(robot: &Robot) -> Option<Self> {
        let e = &robot.extensions;
        if !e.bends_torque_law() && e.rest_curvature.is_empty() && e.joint_gains.is_empty() {
            return None;
        }
        let (joints, m) = (robot.joints(), robot.motors_per_actuator);
        let of_joint = |i: usize| e.rest_curvature.get(i / m).map_or(0.0, |curvature| curvature * robot.link_length());
        Some(Self {
            link: robot.link_length(),
            rest_angles: (0..joints).map(of_joint).collect(),
            gains: (0..joints).map(|i| e.joint_gains.get(i).copied().unwrap_or(1.0)).collect(),
            loss: if e.loss == 0.0 { Vec::new() } else { vec![[0.0; LOSS_TIMES.len()]; joints] },
            largest: 0.0,
            extensions: e.clone(),
        })
    }

    /// Torque of joint `i` (dyn·cm). `voltage` (V) is multiplied by the joint's gain.
    pub(super) fn torque(&mut self, i: usize, joint: &PiezoJoint, angle: f64, rate: f64, voltage: &mut f64) -> f64 {
        *voltage *= self.gains[i];
        let angle = angle - self.rest_angles[i];
        let delta = angle - joint.rest_angle_per_volt * *voltage;
        if self.extensions.softening < 0.0 {
            self.largest = self.largest.max(delta.abs());
        }
        let stored: f64 = self.loss.get(i).map_or(0.0, |chain| chain.iter().sum());
        joint.torque(angle, rate, *voltage) + self.extensions.torque(joint.stiffness, self.link, delta, rate)
            - joint.stiffness * self.extensions.loss * stored
    }

    /// Advances the Prony chains by a step of `dt` (s) at the joints' rates (rad/s).
    pub(super) fn advance(&mut self, rates: &[f64], dt: f64) {
        for (chain, rate) in self.loss.iter_mut().zip(rates) {
            for (q, time) in chain.iter_mut().zip(LOSS_TIMES) {
                *q += dt * (rate - *q / time);
            }
        }
    }
}
