//! The robot's bodies as Bullet's boxes, and rotations.

use super::COLLISION_MARGIN;
use super::sliding::Sliding;
use crate::bullet::{BaseState, BoxLink};
use crate::model::{RigidBody, Robot, Segment, box_inertia};

/// The bodies as boxes whose hinges stand in the faces between them.
pub(super) fn boxes(robot: &Robot, sliding: Option<&Sliding>) -> Vec<BoxLink> {
    let (segments, bodies) = (robot.segments(), robot.rigid_bodies());
    let Robot { material, collision_thickness: thickness, extensions, .. } = robot;
    let left_to_com = |i: usize| bodies[i].middle * segments[i].length;
    let boxes = segments.iter().zip(&bodies).enumerate().map(|(i, (segment, body))| {
        // A link's frame stands in its joint, which is its left end and the right end of the link before.
        BoxLink {
            parent: i.checked_sub(2),
            mass: body.mass,
            inertia: inertia(segment, body, material.width, *thickness),
            half_extents: [0.5 * segment.length, 0.5 * material.width, 0.5 * thickness],
            com_to_box: [0.5 * segment.length - left_to_com(i), 0.0, 0.0],
            parent_com_to_joint: [if i == 0 { 0.0 } else { segments[i - 1].length - left_to_com(i - 1) }, 0.0, 0.0],
            joint_to_com: [if i == 0 { 0.0 } else { left_to_com(i) }, 0.0, 0.0],
            axis: [0.0, 1.0, 0.0],
            friction: sliding.map_or(segment.friction, |sliding| sliding.plain(i)),
            restitution: extensions.restitution,
            collision_margin: COLLISION_MARGIN,
        }
    });
    boxes.collect()
}

/// Moments of inertia (g·cm²) of a body with point masses; `None` for a plain box, whose inertia Bullet computes.
pub(super) fn inertia(segment: &Segment, body: &RigidBody, width: f64, thickness: f64) -> Option<[f64; 3]> {
    let of_box = |a: f64, b: f64| box_inertia(segment.mass, a, b);
    // Point masses lie on the x axis of the box.
    let added = body.inertia - of_box(segment.length, thickness);
    (body.mass != segment.mass).then(|| [of_box(width, thickness), body.inertia, of_box(segment.length, width) + added])
}

pub(super) fn add(to: &mut [f64; 3], by: [f64; 3]) {
    to.iter_mut().zip(by).for_each(|(to, by)| *to += by);
}

pub(super) fn cross([ax, ay, az]: [f64; 3], [bx, by, bz]: [f64; 3]) -> [f64; 3] {
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}

/// Rotation of the base to the world, by rows.
pub(super) fn rotation(base: &BaseState) -> [[f64; 3]; 3] {
    let [x, y, z, w] = base.orientation;
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// Pitch about +y of a body whose x axis points along (x, y, z) in the world (rad): positive lowers the far end.
///
/// For motion in the plane this is atan2(−z, x). Out of it, where contact has tilted or turned the robot a little, it is the
/// angle to the horizontal, which is what PyBullet's Euler angles give the reference; beyond 90° those fold back and this does not.
pub(super) fn pitch([x, y, z]: [f64; 3]) -> f64 {
    (-z).atan2(x.hypot(y).copysign(x))
}

/// Pitch of the base, from the first column of its rotation: its x axis in the world.
pub(super) fn base_pitch(base: &BaseState) -> f64 {
    let [qx, qy, qz, qw] = base.orientation;
    pitch([1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + qw * qz), 2.0 * (qx * qz - qw * qy)])
}
