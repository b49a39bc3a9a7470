//! URDF import: a chain of boxes with hinges about +y.

use std::collections::HashMap;

use roxmltree::Document;
use thiserror::Error;
use urdf_rs::{Geometry, Joint, JointType, Link};

use super::principal_inertias;
use crate::model::{Robot, Segment};

/// A URDF that is not a robot of this program.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum UrdfError {
    /// Not XML, or not URDF.
    #[error("not a URDF: {0}")]
    Syntax(String),
    /// An element that this program cannot simulate.
    #[error("{element}: {reason}")]
    Element {
        /// The link or joint, by name.
        element: String,
        /// What is wrong, and what is needed.
        reason: String,
    },
}

fn fault(element: String, reason: impl Into<String>) -> UrdfError {
    UrdfError::Element { element, reason: reason.into() }
}

/// Relative difference up to which lengths or inertias are equal, well above rounding.
const SAME: f64 = 1e-9;

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME * a.abs().max(b.abs())
}

/// Parses the bodies of a chain from the base on, which must have the width and thickness of `robot`.
///
/// urdf-rs invents missing inertias and limits and drops `<contact>`, so these are read from the XML. `<visual>`, `<dynamics>` (damping is the
/// experiment's) and names are ignored.
///
/// # Errors
/// [`UrdfError`] with the element, if the file is not such a chain.
pub fn bodies(text: &str, robot: &Robot) -> Result<Vec<Segment>, UrdfError> {
    let document = Document::parse(text).map_err(|error| UrdfError::Syntax(error.to_string()))?;
    let frictions = check_xml(&document)?;
    let model = urdf_rs::read_from_string(text).map_err(|error| UrdfError::Syntax(error.to_string()))?;
    let (links, joints) = chain(&model.links, &model.joints)?;
    let mut segments: Vec<Segment> = Vec::new();
    for (i, link) in links.iter().enumerate() {
        let length = body(link, i == 0, robot)?;
        if let Some(joint) = i.checked_sub(1).map(|i| joints[i]) {
            // The frame of the base is in its centre, that of a link at its left end.
            let before = if i == 1 { 0.5 * segments[0].length } else { segments[i - 1].length };
            hinge(joint, before)?;
        }
        let friction = frictions[&link.name];
        segments.push(Segment { length, mass: link.inertial.mass.value, friction });
    }
    Ok(segments)
}

/// Checks the elements that urdf-rs ignores; returns the friction of each link.
fn check_xml(document: &Document) -> Result<HashMap<String, f64>, UrdfError> {
    let root = document.root_element();
    if root.tag_name().name() != "robot" {
        return Err(UrdfError::Syntax(format!("the outermost element is <{}>, not <robot>", root.tag_name().name())));
    }
    let mut frictions = HashMap::new();
    for node in root.children().filter(|node| node.has_tag_name("link")) {
        let name = node.attribute("name").unwrap_or_default();
        let element = format!("link {name:?}");
        let child = |name: &str| node.children().find(|child| child.has_tag_name(name));
        let inertial =
            child("inertial").ok_or_else(|| fault(element.clone(), "has no <inertial>; write its mass and inertia"))?;
        for part in ["mass", "inertia"] {
            if !inertial.children().any(|child| child.has_tag_name(part)) {
                return Err(fault(element, format!("its <inertial> has no <{part}>")));
            }
        }
        let value = child("contact").and_then(|contact| {
            contact.children().find(|child| child.has_tag_name("lateral_friction")).and_then(|node| node.attribute("value"))
        });
        let value = value.ok_or_else(|| fault(element.clone(), "has no <contact><lateral_friction value=…/></contact>"))?;
        let friction = value.parse().ok().filter(|friction: &f64| friction.is_finite() && *friction >= 0.0);
        let friction =
            friction.ok_or_else(|| fault(element.clone(), format!("its friction {value:?} is not a number of zero or more")))?;
        if frictions.insert(name.to_owned(), friction).is_some() {
            return Err(fault(element, "is defined twice"));
        }
    }
    for node in root.children().filter(|node| node.has_tag_name("joint")) {
        let element = format!("joint {:?}", node.attribute("name").unwrap_or_default());
        if node.children().any(|child| child.has_tag_name("mimic")) {
            return Err(fault(element, "mimics another joint, which this program cannot do"));
        }
        let limit = node.children().find(|child| child.has_tag_name("limit"));
        if limit.is_some_and(|limit| limit.has_attribute("lower") || limit.has_attribute("upper")) {
            return Err(fault(element, "has limits, which this program does not simulate; make it continuous"));
        }
    }
    Ok(frictions)
}

/// The links from the base on, and the joints between them.
fn chain<'a>(links: &'a [Link], joints: &'a [Joint]) -> Result<(Vec<&'a Link>, Vec<&'a Joint>), UrdfError> {
    let by_name: HashMap<&str, &Link> = links.iter().map(|link| (link.name.as_str(), link)).collect();
    let mut after: HashMap<&str, &Joint> = HashMap::new();
    let mut is_child: HashMap<&str, &Joint> = HashMap::new();
    for joint in joints {
        let element = || format!("joint {:?}", joint.name);
        for name in [&joint.parent.link, &joint.child.link] {
            if !by_name.contains_key(name.as_str()) {
                return Err(fault(element(), format!("names the link {name:?}, which is not there")));
            }
        }
        if let Some(other) = after.insert(&joint.parent.link, joint) {
            return Err(fault(
                element(),
                format!(
                    "is the second joint on link {:?}, after joint {:?}: chains must not branch",
                    joint.parent.link, other.name
                ),
            ));
        }
        if let Some(other) = is_child.insert(&joint.child.link, joint) {
            return Err(fault(
                element(),
                format!("closes a loop: link {:?} already hangs on joint {:?}", joint.child.link, other.name),
            ));
        }
    }
    let base = links.iter().find(|link| !is_child.contains_key(link.name.as_str()));
    let base = base.ok_or_else(|| UrdfError::Syntax("no link is the base: there are none, or they form a loop".into()))?;
    let (mut chain_links, mut chain_joints) = (vec![base], Vec::new());
    let mut at = base.name.as_str();
    while let Some(joint) = after.get(at) {
        chain_joints.push(*joint);
        at = &joint.child.link;
        chain_links.push(by_name[at]);
    }
    let reached = |link: &&Link| chain_links.iter().any(|found| std::ptr::eq(*found, *link));
    if let Some(apart) = links.iter().find(|link| !reached(link)) {
        return Err(fault(format!("link {:?}", apart.name), "is not connected to the base"));
    }
    if chain_joints.is_empty() {
        return Err(UrdfError::Syntax("there are no joints".into()));
    }
    Ok((chain_links, chain_joints))
}

fn hinge(joint: &Joint, before: f64) -> Result<(), UrdfError> {
    let element = format!("joint {:?}", joint.name);
    if !matches!(joint.joint_type, JointType::Continuous | JointType::Revolute) {
        return Err(fault(element, format!("is {:?}, and must be a hinge (continuous)", joint.joint_type)));
    }
    if joint.axis.xyz.0 != [0.0, 1.0, 0.0] {
        return Err(fault(element, format!("turns about {:?}, and must turn about 0 1 0", joint.axis.xyz.0)));
    }
    let [x, y, z] = joint.origin.xyz.0;
    if joint.origin.rpy.0 != [0.0; 3] || y != 0.0 || z != 0.0 || !same(x, before) {
        let reason = format!("its origin must be {before} 0 0 without turning: at the far end of the link before");
        return Err(fault(element, reason));
    }
    Ok(())
}

/// Checks one link; returns its length (cm).
fn body(link: &Link, base: bool, robot: &Robot) -> Result<f64, UrdfError> {
    let bad = |reason: String| Err(fault(format!("link {:?}", link.name), reason));
    let [collision] = &link.collision[..] else { return bad("must have one <collision>".into()) };
    let Geometry::Box { size } = &collision.geometry else { return bad("its <collision> must be a box".into()) };
    let [length, width, thickness] = size.0;
    if !(length.is_finite() && length > 0.0) {
        return bad(format!("its box is {} long", crate::words::number(length)));
    }
    for (name, found, needed) in [("width", width, robot.material.width), ("thickness", thickness, robot.collision_thickness)] {
        if !same(found, needed) {
            return bad(format!("its {name} is {found} cm, and the experiment's is {needed} cm; change one of them"));
        }
    }
    let mass = link.inertial.mass.value;
    if !(mass.is_finite() && mass > 0.0) {
        return bad(format!("its mass is {mass}"));
    }
    let centre = if base { 0.0 } else { 0.5 * length };
    for (name, pose) in [("inertial", &link.inertial.origin), ("collision", &collision.origin)] {
        let [x, y, z] = pose.xyz.0;
        if pose.rpy.0 != [0.0; 3] || y != 0.0 || z != 0.0 || !(same(x, centre) || x == centre) {
            let payload = if name == "inertial" { "; write payloads as [[robot.mass]] of the experiment" } else { "" };
            return bad(format!("the origin of its <{name}> must be {centre} 0 0 without turning{payload}"));
        }
    }
    let i = &link.inertial.inertia;
    let needed = principal_inertias(mass, [length, width, thickness]);
    let diagonal = [i.ixx, i.iyy, i.izz].iter().zip(needed).all(|(found, needed)| same(*found, needed));
    if !diagonal || [i.ixy, i.ixz, i.iyz] != [0.0; 3] {
        return bad(format!("its inertia must be that of its box at even density, {needed:?}"));
    }
    Ok(length)
}
