//! MJCF export: the complete model for MuJoCo.

use std::fmt::Write;

use super::{Placed, comment, placed};
use crate::engine::LARGEST_FRICTION;
use crate::experiment::Experiment;
use crate::model::{Mount, Robot};

/// The robot of an experiment as MJCF: chain, springs, dampers, floor, and one actuator per joint.
///
/// Actuator `joint_i` takes the target angle θ_V = −β V/m (rad) and adds k·θ_V to the joint's spring −k·θ and damper −k·η·θ̇, which together is
/// eq. 1. Friction coefficients are the products of link and floor, as in Bullet; MuJoCo would take the larger one. Links do not collide.
pub fn mjcf(experiment: &Experiment, command: &str) -> String {
    let robot = &experiment.robot;
    let joint = robot.joint();
    let mut out = String::new();
    let _ = writeln!(
        out,
        "<!-- Made by: {} -->\n<!-- Units: cm, g, s, dyn. Each actuator takes its joint's target angle in rad: {} times the actuator's voltage over {}. -->\n<mujoco model=\"{}-actuators-{}-joints\">\n  <compiler angle=\"radian\" autolimits=\"true\"/>\n  <option gravity=\"0 0 {}\" timestep=\"{}\" integrator=\"implicitfast\" cone=\"elliptic\"/>\n  <default>\n    <joint type=\"hinge\" axis=\"0 1 0\" stiffness=\"{}\" damping=\"{}\"/>\n    <geom type=\"box\" contype=\"1\" conaffinity=\"0\" condim=\"3\" priority=\"1\"/>\n  </default>\n  <worldbody>",
        comment(command),
        joint.rest_angle_per_volt,
        robot.motors_per_actuator,
        robot.actuators,
        robot.joints(),
        -robot.material.gravity,
        experiment.time_step,
        joint.stiffness,
        joint.stiffness * joint.damping_time
    );
    if robot.mount == Mount::Ground {
        let _ = writeln!(
            out,
            "    <geom name=\"floor\" type=\"plane\" pos=\"0 0 {}\" size=\"1000 1000 1\" contype=\"0\" conaffinity=\"1\" priority=\"0\"/>",
            -0.5 * robot.collision_thickness
        );
    }
    let bodies = placed(robot);
    for (i, body) in bodies.iter().enumerate() {
        open_body(&mut out, robot, i, body);
    }
    for i in (0..bodies.len()).rev() {
        let _ = writeln!(out, "{}</body>", indent(i));
    }
    out.push_str("  </worldbody>\n  <actuator>\n");
    for i in 1..bodies.len() {
        let _ = writeln!(out, "    <general name=\"joint_{i}\" joint=\"joint_{i}\" gainprm=\"{}\"/>", joint.stiffness);
    }
    out.push_str("  </actuator>\n</mujoco>\n");
    out
}

fn indent(i: usize) -> String {
    " ".repeat(4 + 2 * i.min(20))
}

fn open_body(out: &mut String, robot: &Robot, i: usize, body: &Placed) {
    let Placed { name, segment, mass, frame, centre, centre_of_mass, size, inertia: [ixx, iyy, izz] } = body;
    let pad = indent(i);
    let joint = match (i, robot.mount) {
        (0, Mount::Clamped) => String::new(),
        (0, _) => "<freejoint/>".into(),
        _ => format!("<joint name=\"joint_{i}\"/>"),
    };
    let friction = (segment.friction * robot.friction.ground).min(LARGEST_FRICTION);
    let [x, y, z] = size.map(|edge| 0.5 * edge);
    let _ = writeln!(
        out,
        "{pad}<body name=\"{name}\" pos=\"{frame} 0 0\">{joint}\n{pad}  <inertial pos=\"{centre_of_mass} 0 0\" mass=\"{mass}\" diaginertia=\"{ixx} {iyy} {izz}\"/>\n{pad}  <geom name=\"{name}\" pos=\"{centre} 0 0\" size=\"{x} {y} {z}\" friction=\"{friction} 0.005 0.0001\"/>"
    );
}
