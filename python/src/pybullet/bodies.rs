//! Making bodies.
// Names are PyBullet's.
#![allow(non_snake_case)]

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use sfers::bullet::{Pose, TreeBody, TreeBox, TreeJoint};

use super::arguments::{integer, integer_list, items, not_negative, number_list, numbers, pose, positive, quaternion};
use super::clients::{Body, Client, with};
use super::{refuse, refused};

/// PyBullet's number of a box.
pub const GEOM_BOX: i32 = 3;
/// PyBullet's number of a hinge.
pub const JOINT_REVOLUTE: i32 = 0;
/// PyBullet's number of a fixed joint.
pub const JOINT_FIXED: i32 = 4;

/// Links that PyBullet has room for.
const MOST_LINKS: usize = 127;
/// Margin of every box, as PyBullet sets it.
const COLLISION_MARGIN: f64 = 0.001;
/// Largest impulse of the motor that PyBullet puts on every hinge.
const MOTOR_IMPULSE: f64 = 1.0;
/// Lateral friction of bodies that are made by calls.
const FRICTION: f64 = 0.5;
/// Half extents of the box in plane.urdf, whose upper face lies at 0, before scaling.
const PLANE_HALF_EXTENTS: [f64; 3] = [100.0, 100.0, 5.0];

/// Makes a box and returns its id.
#[pyfunction]
#[pyo3(signature = (shapeType, radius=None, halfExtents=None, *, collisionFramePosition=None, collisionFrameOrientation=None, physicsClientId=0))]
fn createCollisionShape(
    shapeType: &Bound<'_, PyAny>,
    radius: Option<&Bound<'_, PyAny>>,
    halfExtents: Option<&Bound<'_, PyAny>>,
    collisionFramePosition: Option<&Bound<'_, PyAny>>,
    collisionFrameOrientation: Option<&Bound<'_, PyAny>>,
    physicsClientId: i32,
) -> PyResult<i32> {
    let _ = radius;
    let kind = integer("shapeType", shapeType)?;
    if kind != GEOM_BOX {
        return Err(refuse(format!("createCollisionShape failed: shapeType is {kind}, but this drop-in has GEOM_BOX only")));
    }
    let half_extents = halfExtents.ok_or_else(|| refuse("createCollisionShape failed: halfExtents is missing"))?;
    for value in items("halfExtents", half_extents)? {
        positive("halfExtents", &value)?;
    }
    let shape = TreeBox {
        half_extents: numbers("halfExtents", half_extents)?,
        pose: pose(["collisionFramePosition", "collisionFrameOrientation"], collisionFramePosition, collisionFrameOrientation)?,
    };
    with(physicsClientId, |client| {
        client.shapes.push(shape);
        id_of("createCollisionShape", client.shapes.len())
    })
}

fn id_of(what: &str, count: usize) -> PyResult<i32> {
    i32::try_from(count - 1).map_err(|_| refuse(format!("{what}: too many")))
}

/// What createMultiBody is told about the links, one entry per link.
struct Links {
    masses: Vec<f64>,
    shapes: Vec<i32>,
    poses: Vec<Pose>,
    inertial: Vec<Pose>,
    parents: Vec<usize>,
    joints: Vec<TreeJoint>,
    axes: Vec<[f64; 3]>,
}

/// One list of values per link, empty if it is not given.
fn rows<const N: usize>(name: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<[f64; N]>> {
    value.map_or(Ok(Vec::new()), |value| items(name, value)?.iter().map(|row| numbers(name, row)).collect())
}

/// The links in depth-first order, as PyBullet numbers them: a link, then all that hangs on it, children in the order given. The numbers are
/// those of `parents`, where 0 is the base and link `i` is `i + 1`.
fn depth_first(parents: &[usize]) -> PyResult<Vec<usize>> {
    let children = |parent: usize| (0..parents.len()).rev().filter(move |&link| parents[link] == parent);
    let mut waiting: Vec<usize> = children(0).collect();
    let mut order = Vec::with_capacity(parents.len());
    while let Some(link) = waiting.pop() {
        order.push(link);
        waiting.extend(children(link + 1));
    }
    if order.len() == parents.len() {
        Ok(order)
    } else {
        Err(refuse(format!("linkParentIndices makes no tree: {parents:?} (0 is the base, i + 1 is link i)")))
    }
}

fn shape_of(client: &Client, name: &str, id: i32) -> PyResult<Option<TreeBox>> {
    match usize::try_from(id) {
        Err(_) => Ok(None),
        Ok(index) => match client.shapes.get(index) {
            Some(shape) => Ok(Some(*shape)),
            None => Err(refuse(format!("{name} is {id}, but there is no such shape"))),
        },
    }
}

/// Makes a body of boxes and joints and returns its id.
#[pyfunction]
#[pyo3(signature = (
    baseMass=None, baseCollisionShapeIndex=-1, baseVisualShapeIndex=-1, basePosition=None, baseOrientation=None,
    baseInertialFramePosition=None, baseInertialFrameOrientation=None, linkMasses=None, linkCollisionShapeIndices=None,
    linkVisualShapeIndices=None, linkPositions=None, linkOrientations=None, linkInertialFramePositions=None,
    linkInertialFrameOrientations=None, linkParentIndices=None, linkJointTypes=None, linkJointAxis=None, physicsClientId=0
))]
#[allow(clippy::too_many_arguments)]
fn createMultiBody(
    baseMass: Option<&Bound<'_, PyAny>>,
    baseCollisionShapeIndex: i32,
    baseVisualShapeIndex: i32,
    basePosition: Option<&Bound<'_, PyAny>>,
    baseOrientation: Option<&Bound<'_, PyAny>>,
    baseInertialFramePosition: Option<&Bound<'_, PyAny>>,
    baseInertialFrameOrientation: Option<&Bound<'_, PyAny>>,
    linkMasses: Option<&Bound<'_, PyAny>>,
    linkCollisionShapeIndices: Option<&Bound<'_, PyAny>>,
    linkVisualShapeIndices: Option<&Bound<'_, PyAny>>,
    linkPositions: Option<&Bound<'_, PyAny>>,
    linkOrientations: Option<&Bound<'_, PyAny>>,
    linkInertialFramePositions: Option<&Bound<'_, PyAny>>,
    linkInertialFrameOrientations: Option<&Bound<'_, PyAny>>,
    linkParentIndices: Option<&Bound<'_, PyAny>>,
    linkJointTypes: Option<&Bound<'_, PyAny>>,
    linkJointAxis: Option<&Bound<'_, PyAny>>,
    physicsClientId: i32,
) -> PyResult<i32> {
    let mass = baseMass.map_or(Ok(0.0), |mass| not_negative("baseMass", mass))?;
    let base = pose(["basePosition", "baseOrientation"], basePosition, baseOrientation)?;
    let inertial = pose(
        ["baseInertialFramePosition", "baseInertialFrameOrientation"],
        baseInertialFramePosition,
        baseInertialFrameOrientation,
    )?;
    let visuals = linkVisualShapeIndices.map_or(Ok(Vec::new()), |value| integer_list("linkVisualShapeIndices", value))?;
    if baseVisualShapeIndex >= 0 || visuals.iter().any(|&index| index >= 0) {
        return Err(refuse("baseVisualShapeIndex, linkVisualShapeIndices: this drop-in has no visual shapes, only -1"));
    }
    let links = Links {
        masses: linkMasses.map_or(Ok(Vec::new()), |value| number_list("linkMasses", value))?,
        shapes: linkCollisionShapeIndices.map_or(Ok(Vec::new()), |value| integer_list("linkCollisionShapeIndices", value))?,
        poses: poses(["linkPositions", "linkOrientations"], linkPositions, linkOrientations)?,
        inertial: poses(
            ["linkInertialFramePositions", "linkInertialFrameOrientations"],
            linkInertialFramePositions,
            linkInertialFrameOrientations,
        )?,
        parents: linkParentIndices.map_or(Ok(Vec::new()), |value| parents(&integer_list("linkParentIndices", value)?))?,
        joints: linkJointTypes
            .map_or(Ok(Vec::new()), |value| integer_list("linkJointTypes", value)?.into_iter().map(joint).collect())?,
        axes: rows("linkJointAxis", linkJointAxis)?,
    };
    let count = links.masses.len();
    for (name, found) in [
        ("linkCollisionShapeIndices", links.shapes.len()),
        ("linkVisualShapeIndices", visuals.len()),
        ("linkPositions, linkOrientations", links.poses.len()),
        ("linkInertialFramePositions, linkInertialFrameOrientations", links.inertial.len()),
        ("linkParentIndices", links.parents.len()),
        ("linkJointTypes", links.joints.len()),
        ("linkJointAxis", links.axes.len()),
    ] {
        if found != count {
            let message = "All link arrays need to be same size";
            return Err(refuse(format!("{message}: {name} has {found} entries, linkMasses {count}")));
        }
    }
    if count > MOST_LINKS {
        return Err(refuse(format!("linkMasses has {count} entries, but a body has at most {MOST_LINKS} links")));
    }
    if let Some(mass) = links.masses.iter().find(|mass| **mass < 0.0) {
        return Err(refuse(format!("linkMasses has {mass}, but a mass must not be negative")));
    }
    with(physicsClientId, |client| {
        let shape = shape_of(client, "baseCollisionShapeIndex", baseCollisionShapeIndex)?;
        let mut bodies = vec![body(mass, base, inertial, shape)];
        bodies.extend(tree(client, &links)?);
        add(client, "createMultiBody", &bodies)
    })
}

fn poses(names: [&str; 2], positions: Option<&Bound<'_, PyAny>>, orientations: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<Pose>> {
    let (positions, orientations) = (rows(names[0], positions)?, rows(names[1], orientations)?);
    if positions.len() != orientations.len() {
        let (a, b) = (positions.len(), orientations.len());
        return Err(refuse(format!("All link arrays need to be same size: {} has {a} entries, {} {b}", names[0], names[1])));
    }
    let paired = positions.into_iter().zip(orientations);
    paired.map(|(position, q)| Ok(Pose { position, orientation: quaternion(names[1], q)? })).collect()
}

fn parents(indices: &[i32]) -> PyResult<Vec<usize>> {
    let parent = |&index| usize::try_from(index).map_err(|_| refuse(format!("linkParentIndices has {index}; 0 is the base")));
    indices.iter().map(parent).collect()
}

fn joint(kind: i32) -> PyResult<TreeJoint> {
    match kind {
        JOINT_REVOLUTE => Ok(TreeJoint::Revolute),
        JOINT_FIXED => Ok(TreeJoint::Fixed),
        _ => Err(refuse(format!("linkJointTypes has {kind}, but this drop-in has JOINT_REVOLUTE and JOINT_FIXED only"))),
    }
}

fn body(mass: f64, pose: Pose, inertial: Pose, shape: Option<TreeBox>) -> TreeBody {
    TreeBody {
        mass,
        pose,
        inertial,
        shape,
        axis: [0.0, 1.0, 0.0],
        joint: TreeJoint::Fixed,
        parent: None,
        friction: FRICTION,
        collision_margin: COLLISION_MARGIN,
        compound_margin: 0.0,
    }
}

/// The links in PyBullet's order.
fn tree(client: &Client, links: &Links) -> PyResult<Vec<TreeBody>> {
    let order = depth_first(&links.parents)?;
    let mut place = vec![0; order.len()];
    for (at, &link) in order.iter().enumerate() {
        place[link] = at;
    }
    let link = |&link: &usize| {
        let axis = links.axes[link];
        if links.joints[link] == TreeJoint::Revolute && axis.iter().map(|v| v * v).sum::<f64>() < 1e-12 {
            return Err(refuse(format!("linkJointAxis has {axis:?}, which is no axis")));
        }
        let shape = shape_of(client, "linkCollisionShapeIndices", links.shapes[link])?;
        Ok(TreeBody {
            axis,
            joint: links.joints[link],
            parent: links.parents[link].checked_sub(1).map(|parent| place[parent]),
            ..body(links.masses[link], links.poses[link], links.inertial[link], shape)
        })
    };
    order.iter().map(link).collect()
}

fn add(client: &mut Client, what: &str, bodies: &[TreeBody]) -> PyResult<i32> {
    let id = client.world.add_tree(bodies, MOTOR_IMPULSE).map_err(refused(what))?;
    let revolute = bodies[1..].iter().map(|body| body.joint == TreeJoint::Revolute).collect();
    client.bodies.push(Body { id, links: bodies.len() - 1, revolute });
    id_of(what, client.bodies.len())
}

/// Lays the floor of pybullet_data's plane.urdf and returns its id.
#[pyfunction]
#[pyo3(signature = (fileName, basePosition=None, baseOrientation=None, useMaximalCoordinates=0, useFixedBase=0, flags=0, globalScaling=None, physicsClientId=0))]
#[allow(clippy::too_many_arguments)]
fn loadURDF(
    fileName: PathBuf,
    basePosition: Option<&Bound<'_, PyAny>>,
    baseOrientation: Option<&Bound<'_, PyAny>>,
    useMaximalCoordinates: i32,
    useFixedBase: i32,
    flags: i32,
    globalScaling: Option<&Bound<'_, PyAny>>,
    physicsClientId: i32,
) -> PyResult<i32> {
    let _ = useFixedBase;
    if useMaximalCoordinates != 0 || flags != 0 {
        return Err(refuse("useMaximalCoordinates, flags: this drop-in has only 0"));
    }
    if fileName.file_name() != Some("plane.urdf".as_ref()) {
        return Err(refuse(format!(
            "Cannot load URDF file: fileName is {}; this drop-in has plane.urdf only",
            fileName.display()
        )));
    }
    let pose = pose(["basePosition", "baseOrientation"], basePosition, baseOrientation)?;
    let scale = globalScaling.map_or(Ok(1.0), |scale| positive("globalScaling", scale))?;
    let half_extents = PLANE_HALF_EXTENTS.map(|half| half * scale);
    let under = Pose { position: [0.0, 0.0, -half_extents[2]], ..Pose::IDENTITY };
    with(physicsClientId, |client| {
        let found = |folder: &Path| folder.join(&fileName).is_file();
        if !found(Path::new("")) && !client.search_path.as_deref().is_some_and(found) {
            let hint = "call setAdditionalSearchPath(pybullet_data.getDataPath()) first";
            return Err(refuse(format!("Cannot load URDF file: fileName is {}: {hint}", fileName.display())));
        }
        let plane = TreeBody {
            friction: 1.0,
            compound_margin: COLLISION_MARGIN,
            ..body(0.0, pose, Pose::IDENTITY, Some(TreeBox { half_extents, pose: under }))
        };
        add(client, "loadURDF", &[plane])
    })
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(createCollisionShape, module)?)?;
    module.add_function(wrap_pyfunction!(createMultiBody, module)?)?;
    module.add_function(wrap_pyfunction!(loadURDF, module)?)
}
