//! What a drive must fit.

use crate::model::Robot;

/// What a drive must fit.
pub(super) struct Driven<'a> {
    robot: &'a Robot,
    pub actuators: usize,
    positive_gain: f64,
}

impl<'a> Driven<'a> {
    /// A robot whose positive voltages are multiplied by `positive_gain` (–).
    pub fn new(robot: &'a Robot, positive_gain: f64) -> Self {
        Self { robot, actuators: robot.actuators, positive_gain }
    }

    /// Checks that the material bears a voltage (V).
    pub fn check_voltage(&self, voltage: f64) -> Result<(), String> {
        self.robot.check_voltage(voltage, self.positive_gain)
    }
}
