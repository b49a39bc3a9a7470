//! The JSON sidecar of a URDF.

use serde_json::{Value, json};

use crate::experiment::Experiment;
use crate::model::Mount;

/// Springs, target angles, damping, mount, floor, drive and time step of an experiment, as JSON.
pub fn sidecar(experiment: &Experiment, command: &str) -> Value {
    let robot = &experiment.robot;
    let joint = robot.joint();
    json!({
        "schema": 1,
        "made_by": command,
        "units": "cm, g, s, dyn, rad, V",
        "torque_law": "torque = -stiffness * ((angle - rest_angle_per_volt * voltage / motors_per_actuator) + damping_time * rate)",
        "actuators": robot.actuators,
        "motors_per_actuator": robot.motors_per_actuator,
        "joint_stiffness_dyn_cm_per_rad": joint.stiffness,
        "rest_angle_per_volt_rad_per_v": joint.rest_angle_per_volt,
        "damping_time_s": joint.damping_time,
        "joint_damping_dyn_cm_s_per_rad": joint.stiffness * joint.damping_time,
        "positive_gain": experiment.drive.positive_gain,
        "mount": robot.mount.name(),
        "gravity_cm_s2": robot.material.gravity,
        "floor": (robot.mount == Mount::Ground).then(|| json!({"height_cm": -0.5 * robot.collision_thickness, "friction": robot.friction.ground})),
        "time_step_s": experiment.time_step,
        "drive": experiment.spec()["drive"],
    })
}
