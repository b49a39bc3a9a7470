//! The robots for other simulators: URDF out and in, MJCF, and what URDF cannot say as JSON beside it.
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

use crate::model::{Robot, Segment};

/// A body as both formats need it.
struct Placed {
    /// `link_0` at the left end.
    name: String,
    segment: Segment,
    /// From the parent's frame to this one's along x (cm). The base's frame stands in its centre, a link's in its joint.
    frame: f64,
    /// From the frame to the centre of mass along x (cm).
    centre: f64,
    /// Full extents of the box (cm).
    size: [f64; 3],
    /// About the centre of mass (g·cm²): that of a box of even density, m (b² + c²)/12.
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
                inertia: box_inertia(segment.mass, size),
            }
        })
        .collect()
}

/// Inertia (g·cm²) about the axes of a box of even density.
fn box_inertia(mass: f64, [x, y, z]: [f64; 3]) -> [f64; 3] {
    [mass / 12.0 * (y * y + z * z), mass / 12.0 * (x * x + z * z), mass / 12.0 * (x * x + y * y)]
}

/// Text for an XML comment, in which two hyphens may not follow one another.
fn comment(text: &str) -> String {
    crate::xml::escape(&text.replace("--", "- -"))
}
