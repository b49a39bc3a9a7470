//! Joint torques beyond eq. 1.

use crate::actuator::PiezoJoint;
use crate::model::{Extensions, LOSS_TIMES, Robot, Slip};

/// Joint torques beyond eq. 1. Like the torque law they act with the state at a step's start.
pub(super) struct JointExtensions {
    extensions: Extensions,
    pub(super) link: f64,
    /// Rest angle at 0 V of each joint (rad), and factor on its voltage.
    rest_angles: Vec<f64>,
    gains: Vec<f64>,
    /// Factor on the stiffness of each joint.
    stiffness: Vec<f64>,
    /// Memory of each joint, joints × states: q_j of its Prony chain, then the elastic angles of its springs with a limit (rad).
    pub(super) memory: Vec<f64>,
    /// Number of a joint's states.
    states: usize,
    /// Largest elastic angle so far (rad), if joints harden with it.
    pub(super) largest: f64,
}

impl JointExtensions {
    /// `None` for the plain model.
    pub(super) fn new(robot: &Robot) -> Option<Self> {
        let e = &robot.extensions;
        if !e.bends_torque_law() && e.rest_curvature.is_empty() && e.joint_gains.is_empty() && e.joint_stiffness.is_empty() {
            return None;
        }
        let (joints, m) = (robot.joints(), robot.motors_per_actuator);
        let chain = if e.has_loss() { LOSS_TIMES.len() } else { 0 };
        let of_joint = |i: usize| e.rest_curvature.get(i / m).map_or(0.0, |curvature| curvature * robot.link_length());
        Some(Self {
            link: robot.link_length(),
            rest_angles: (0..joints).map(of_joint).collect(),
            gains: (0..joints).map(|i| e.joint_gains.get(i).copied().unwrap_or(1.0)).collect(),
            stiffness: (0..joints).map(|i| e.joint_stiffness.get(i).copied().unwrap_or(1.0)).collect(),
            memory: vec![0.0; joints * (chain + e.slips.len())],
            states: chain + e.slips.len(),
            largest: 0.0,
            extensions: e.clone(),
        })
    }

    /// Torque of joint `i` (dyn·cm). `voltage` (V) is multiplied by the joint's gain.
    pub(super) fn torque(&mut self, i: usize, joint: &PiezoJoint, angle: f64, rate: f64, voltage: &mut f64) -> f64 {
        *voltage *= self.gains[i];
        let joint = &PiezoJoint { stiffness: joint.stiffness * self.stiffness[i], ..*joint };
        let seen = angle;
        let angle = angle - self.rest_angles[i];
        let delta = angle - joint.rest_angle_per_volt * *voltage;
        if self.extensions.softening < 0.0 {
            self.largest = self.largest.max(delta.abs());
        }
        let own = &self.memory[i * self.states..(i + 1) * self.states];
        let (chain, slips) = own.split_at(self.states - self.extensions.slips.len());
        let stored: f64 = chain.iter().zip(&self.extensions.loss).map(|(q, share)| share * q).sum();
        let of = |(elastic, slip): (&f64, &Slip)| slip.moment * elastic / (slip.curvature * self.link);
        let slipping: f64 = slips.iter().zip(&self.extensions.slips).map(of).sum();
        joint.torque(angle, rate, *voltage) + self.extensions.torque(joint.stiffness, self.link, [seen, delta], rate)
            - joint.stiffness * stored
            - slipping
    }

    /// Advances the joints' memory by a step of `dt` (s) at their rates (rad/s).
    pub(super) fn advance(&mut self, rates: &[f64], dt: f64) {
        if self.states == 0 {
            return;
        }
        let count = self.states - self.extensions.slips.len();
        for (own, rate) in self.memory.chunks_exact_mut(self.states).zip(rates) {
            let (chain, slips) = own.split_at_mut(count);
            for (q, time) in chain.iter_mut().zip(LOSS_TIMES) {
                *q += dt * (rate - *q / time);
            }
            for (elastic, slip) in slips.iter_mut().zip(&self.extensions.slips) {
                let limit = slip.curvature * self.link;
                *elastic = (*elastic + dt * rate).clamp(-limit, limit);
            }
        }
    }
}
