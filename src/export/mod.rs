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

use crate::model::{Robot, Segment, box_inertia};

/// A body of a URDF or MJCF file.
struct Placed {
    /// `link_0` at the left end.
    name: String,
    segment: Segment,
    /// Distance from the parent's frame along x (cm). The frame of the base is in its centre, that of a link in its joint.
    frame: f64,
    /// Distance from the frame to the centre of mass along x (cm).
    centre: f64,
    /// Full extents of the box (cm).
    size: [f64; 3],
    /// Inertia about the centre of mass (g·cm²): that of a homogeneous box.
    inertia: [f64; 3],
}

fn placed(robot: &Robot) -> Vec<Placed> {
    let segments = robot.segments();
    let frame = |i: usize| match i {
        0 => 0.0,
        1 => 0.5 * segments[0].length,
        _ => segments[i - 1].length,
    };
    segments
        .iter()
        .enumerate()
        .map(|(i, segment)| {
            let size = [segment.length, robot.material.width, robot.collision_thickness];
            Placed {
                name: format!("link_{i}"),
                segment: *segment,
                frame: frame(i),
                centre: if i == 0 { 0.0 } else { 0.5 * segment.length },
                size,
                inertia: principal_inertias(segment.mass, size),
            }
        })
        .collect()
}

/// Principal moments of inertia (g·cm²) of a homogeneous box.
fn principal_inertias(mass: f64, [x, y, z]: [f64; 3]) -> [f64; 3] {
    [box_inertia(mass, y, z), box_inertia(mass, x, z), box_inertia(mass, x, y)]
}

/// Text for an XML comment, which must not contain two successive hyphens.
fn comment(text: &str) -> String {
    crate::xml::escape(&text.replace("--", "- -"))
}
