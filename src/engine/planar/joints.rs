//! The joints: voltages in; angles, rates and torques out.

use wide::f64x2;

use super::lanes::Lanes;
use super::{EngineError, LARGEST_COORDINATE, PlanarEngine};

impl PlanarEngine {
    /// Sets the joints' voltages and rest angles, if the actuators' `voltages` (V) have changed.
    pub(super) fn apply(&mut self, voltages: &[f64]) {
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        if self.voltages.len() == voltages.len() && self.voltages.iter().zip(voltages).all(same) {
            return;
        }
        self.voltages.clear();
        self.voltages.extend_from_slice(voltages);
        let m = self.motors_per_actuator;
        let state = &mut self.state;
        for (joints, volts) in state.motor_voltages.chunks_exact_mut(m).zip(voltages) {
            joints.fill(volts / m as f64);
        }
        for (volts, gain) in state.motor_voltages.iter_mut().zip(&self.gains) {
            *volts *= gain;
        }
        for k in 1..self.levels {
            let (quad, level) = (&mut self.quads[k / 2], k % 2);
            let (left, right) = joints_of(k, self.root);
            let volts = |joint: Option<usize>| joint.and_then(|i| state.motor_voltages.get(i)).copied().unwrap_or(0.0);
            // In the sense of rotation from the root outwards, joint angles have their own sign on the left arm and the opposite one on the right.
            let volts = f64x2::new([volts(left), -volts(Some(right))]);
            let mut rest_angle = f64x2::splat(self.joint.rest_angle_per_volt) * volts;
            if !self.rest_angles.is_empty() {
                let rest = |joint: Option<usize>| joint.and_then(|i| self.rest_angles.get(i)).copied().unwrap_or(0.0);
                rest_angle += f64x2::new([rest(left), -rest(Some(right))]);
            }
            quad.volts.set_level(level, volts);
            quad.rest_angle.set_level(level, rest_angle);
        }
    }

    /// Reads the joints' angles and rates, and computes their torques.
    pub(super) fn read_joints(&mut self) {
        let state = &mut self.state;
        let lag = Lanes::splat(self.joint.damping_time);
        let mut before = [f64x2::ZERO; 2];
        for (k, quad) in self.quads.iter().enumerate() {
            let angle = quad.angle - quad.angle.inner(before[0]);
            let rate = quad.motion[0] - quad.motion[0].inner(before[1]);
            before = [quad.angle.level(1), quad.motion[0].level(1)];
            let mut torque = quad.stiffness * (angle - quad.rest_angle + lag * rate);
            if let Some(extensions) = &self.extensions {
                torque += -extensions.now(k, quad, angle - quad.rest_angle, rate);
            }
            // The root, in the first two lanes, has no joint.
            for lane in if k == 0 { 2..4 } else { 0..4 } {
                let (left, right) = joints_of(2 * k + lane / 2, self.root);
                let (joint, sign) = if lane % 2 == 0 { (left, 1.0) } else { (Some(right), -1.0) };
                if let Some(i) = joint.filter(|i| *i < state.angles.len()) {
                    let [angle, rate, torque] = [angle, rate, torque].map(|of| sign * of.lane(lane));
                    (state.angles[i], state.rates[i], state.torques[i]) = (angle, rate, -torque);
                }
            }
        }
    }

    /// Fails if a coordinate is not finite or exceeds `LARGEST_COORDINATE`.
    pub(super) fn check_finite(&mut self) -> Result<(), EngineError> {
        self.read_joints();
        let sound = |value: f64| value.abs() <= LARGEST_COORDINATE;
        let bad = self.state.angles.iter().zip(&self.state.rates).position(|(a, r)| !sound(*a) || !sound(*r));
        if bad.is_none() && self.centre.iter().chain(&self.velocity).all(|value| sound(*value)) {
            self.finite = true;
            return Ok(());
        }
        let of_joint = |joint: usize| [self.state.angles[joint], self.state.rates[joint]];
        let (what, values) = match bad {
            Some(joint) => (format!("the angle or rate of joint {}", joint + 1), of_joint(joint).to_vec()),
            None => ("the centre of mass".to_owned(), [self.centre, self.velocity].concat()),
        };
        let value = values.into_iter().find(|value| !sound(*value)).unwrap_or(f64::NAN);
        let time = self.step as f64 * self.time_step;
        Err(EngineError::NotFinite { what, value, step: self.step, time, stable_step: None })
    }
}

/// The joints at the reference points of tree level `k`: on the right of the left arm's body, and on the left of the right arm's body, which may be padding.
fn joints_of(k: usize, root: usize) -> (Option<usize>, usize) {
    (root.checked_sub(k), root + k - 1)
}
