//! The torque law of a piezoelectric joint.

/// One joint of the chain: a spring and damper about an angle that the voltage sets.
///
/// ```text
/// τ = −k·((θ − θ_V) + η·θ̇)        θ_V = r·V          (eq. 1 and 4)
/// ```
///
/// Frame: the joint axis is +y, x runs along the chain, z is up; a positive θ lowers the far end.
///
/// Valid below 1000 ppm strain. Not modelled: hysteresis, creep, stiffness that depends on amplitude. On Bullet the law is
/// evaluated at the start of a step, so a step must stay below [`stable_step`](crate::analytic::stable_step). The planar engine takes stiffness, rest angle and
/// damping time from here into its implicit step.
///
/// # Examples
/// ```
/// use sfers::actuator::PiezoJoint;
/// let joint = PiezoJoint { stiffness: 1.5e6, rest_angle_per_volt: -1.2e-4, damping_time: 7.0e-3 };
/// let at_rest = joint.rest_angle_per_volt * 1500.0;
/// assert_eq!(joint.torque(at_rest, 0.0, 1500.0), 0.0); // free joint: no moment
/// assert!(joint.torque(0.0, 0.0, 1500.0) < 0.0); // blocked joint: pulls towards θ_V
/// assert!(joint.torque(0.0, 1.0, 0.0) < 0.0); // damping opposes the motion
/// ```
///
/// # References
/// Zheng et al., ICRA 2022, doi:10.1109/ICRA46639.2022.9811927, eqs. 1 to 4. No departures: the order of operations is that of the
/// authors' code, so the results have its bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PiezoJoint {
    /// k (dyn·cm/rad), for the full width.
    pub stiffness: f64,
    /// r (rad/V): rest angle per volt on this joint; a joint gets 1/m of its actuator's voltage.
    pub rest_angle_per_volt: f64,
    /// η (s).
    pub damping_time: f64,
}

impl PiezoJoint {
    /// Torque on the child link (dyn·cm).
    ///
    /// `theta` (rad) and `theta_dot` (rad/s) are the joint's, `voltage` (V) is the actuator's voltage divided by m.
    pub fn torque(&self, theta: f64, theta_dot: f64, voltage: f64) -> f64 {
        let rest_angle = self.rest_angle_per_volt * voltage;
        -self.stiffness * ((theta - rest_angle) + self.damping_time * theta_dot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spring_gives_back_what_it_took_and_a_damper_never_gives() {
        let joint = PiezoJoint { stiffness: 2.0, rest_angle_per_volt: -0.1, damping_time: 0.5 };
        // The elastic part is odd about the rest angle.
        let rest = joint.rest_angle_per_volt * 3.0;
        assert_eq!(joint.torque(rest + 0.25, 0.0, 3.0), -0.5);
        assert!((joint.torque(rest - 0.25, 0.0, 3.0) - 0.5).abs() < 1e-15);
        // The damping torque's power is never positive.
        for rate in [-2.0, -0.1, 0.3, 5.0] {
            let power = (joint.torque(0.1, rate, 0.0) - joint.torque(0.1, 0.0, 0.0)) * rate;
            assert!(power < 0.0);
        }
    }
}
