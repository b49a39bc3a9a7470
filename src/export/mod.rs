//! Robots for other simulators: URDF export and import, MJCF, and a JSON sidecar of URDF.
//!
//! All numbers are in the program's units, CGS: cm, g, s, dyn. A simulator that takes them as m, kg, s computes the same motion as long as
//! gravity is given in cm/s² too; forces and energies then come out in dyn and erg.

mod mjcf;
mod sidecar;
mod urdf;
mod urdf_in;

pub use mjcf::mjcf;
pub use sidecar::sidecar;
pub use urdf::urdf;
pub use urdf_in::{UrdfError, bodies};

use crate::model::{RigidBody, Robot, Segment, box_inertia};

/// A body of a URDF or MJCF file.
struct Placed {
    /// `link_0` at the left end.
    name: String,
    segment: Segment,
    /// Mass with payloads (g).
    mass: f64,
    /// Distance from the parent's frame along x (cm). The frame of the base is in its centre, that of a link in its joint.
    frame: f64,
    /// Distance from the frame to the box's centre along x (cm).
    centre: f64,
    /// Distance from the frame to the centre of mass along x (cm).
    centre_of_mass: f64,
    /// Full extents of the box (cm).
    size: [f64; 3],
    /// Inertia about the centre of mass (g·cm²): that of a homogeneous box with payloads on its centre line.
    inertia: [f64; 3],
}

fn placed(robot: &Robot) -> Vec<Placed> {
    let (segments, bodies) = (robot.segments(), robot.rigid_bodies());
    let frame = |i: usize| match i {
        0 => 0.0,
        1 => 0.5 * segments[0].length,
        _ => segments[i - 1].length,
    };
    segments
        .iter()
        .zip(&bodies)
        .enumerate()
        .map(|(i, (segment, body))| {
            let size = [segment.length, robot.material.width, robot.collision_thickness];
            let centre = if i == 0 { 0.0 } else { 0.5 * segment.length };
            Placed {
                name: format!("link_{i}"),
                segment: *segment,
                frame: frame(i),
                mass: body.mass,
                centre,
                centre_of_mass: if body.middle == 0.5 { centre } else { centre + (body.middle - 0.5) * segment.length },
                size,
                inertia: inertias(segment, body, size),
            }
        })
        .collect()
}

/// Principal moments of inertia (g·cm²) of a body, whose payloads add the same about y and z.
fn inertias(segment: &Segment, body: &RigidBody, size: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = principal_inertias(segment.mass, size);
    if body.mass == segment.mass { [x, y, z] } else { [x, body.inertia, z + (body.inertia - y)] }
}

/// Principal moments of inertia (g·cm²) of a homogeneous box.
fn principal_inertias(mass: f64, [x, y, z]: [f64; 3]) -> [f64; 3] {
    [box_inertia(mass, y, z), box_inertia(mass, x, z), box_inertia(mass, x, y)]
}

/// Text for an XML comment, which must not contain two successive hyphens.
fn comment(text: &str) -> String {
    crate::xml::escape(&text.replace("--", "- -"))
}
