//! URDF export.

use std::fmt::Write;

use super::{Placed, comment, placed};
use crate::experiment::Experiment;
use crate::model::Mount;

/// The robot of an experiment as URDF, with `command` in a comment.
///
/// Links with explicit inertias, one continuous joint about +y between neighbours (no limits), Bullet's `<contact>` for friction, and k·η as
/// the joints' damping. Springs and drives, which URDF lacks, are in the [`sidecar`](super::sidecar). A simulator that applies the torque law of
/// eq. 1 must set the joints' damping to zero, or it would damp twice.
pub fn urdf(experiment: &Experiment, command: &str) -> String {
    let robot = &experiment.robot;
    let joint = robot.joint();
    let mut out = String::new();
    let base = match robot.mount {
        Mount::Clamped => {
            "link_0 is held in the world: fix it with a constraint. (Fixing the base itself gives a slightly stiffer robot.)"
        }
        Mount::Ground => "The robot lies on a floor whose top is half a thickness below the origin.",
        Mount::Free => "The robot is free.",
    };
    let _ = writeln!(
        out,
        "<?xml version=\"1.0\"?>\n<!-- Made by: {} -->\n<!-- Units: cm, g, s, dyn; use gravity in cm/s^2. {base}\n     Springs, voltages and gait stand in the .json beside this file. Whoever applies the torque law with its\n     damping must set the joints' damping to zero. -->\n<robot name=\"{}-actuators-{}-joints\">",
        comment(command),
        robot.actuators,
        robot.joints()
    );
    let bodies = placed(robot);
    for (i, body) in bodies.iter().enumerate() {
        if i > 0 {
            hinge(&mut out, i, body, joint.stiffness * joint.damping_time);
        }
        link(&mut out, body);
    }
    out.push_str("</robot>\n");
    out
}

fn link(out: &mut String, body: &Placed) {
    let Placed { name, segment, mass, centre, centre_of_mass, size: [x, y, z], inertia: [ixx, iyy, izz], .. } = body;
    let origin = |x: &f64| format!("<origin xyz=\"{x} 0 0\" rpy=\"0 0 0\"/>");
    let shape = format!("{}<geometry><box size=\"{x} {y} {z}\"/></geometry>", origin(centre));
    let _ = writeln!(
        out,
        "  <link name=\"{name}\">\n    <inertial>{}<mass value=\"{mass}\"/>\n      <inertia ixx=\"{ixx}\" iyy=\"{iyy}\" izz=\"{izz}\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>\n    <contact><lateral_friction value=\"{}\"/></contact>\n    <visual>{shape}</visual>\n    <collision>{shape}</collision>\n  </link>",
        origin(centre_of_mass),
        segment.friction
    );
}

fn hinge(out: &mut String, i: usize, body: &Placed, damping: f64) {
    let _ = writeln!(
        out,
        "  <joint name=\"joint_{i}\" type=\"continuous\">\n    <parent link=\"link_{}\"/><child link=\"link_{i}\"/>\n    <origin xyz=\"{} 0 0\" rpy=\"0 0 0\"/><axis xyz=\"0 1 0\"/>\n    <dynamics damping=\"{damping}\" friction=\"0\"/>\n  </joint>",
        i - 1,
        body.frame
    );
}
