//! What a world is built of, and what is read back from it.

/// One rigid body of a multibody, with a box to touch things with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxLink {
    /// Index of the parent link; `None` hangs the link on the base. Ignored for the base.
    pub parent: Option<usize>,
    /// Mass (g).
    pub mass: f64,
    /// Moments of inertia about the centre of mass, along the box's axes (g·cm²); `None` is Bullet's own for a box of these extents whose
    /// mass is spread evenly.
    pub inertia: Option<[f64; 3]>,
    /// Half the box's edges along x, y, z (cm).
    pub half_extents: [f64; 3],
    /// From the centre of mass to the box's centre (cm), in this body's frame.
    pub com_to_box: [f64; 3],
    /// From the parent's centre of mass to the hinge (cm), in the parent's frame. Ignored for the base.
    pub parent_com_to_joint: [f64; 3],
    /// From the hinge to this body's centre of mass (cm), in this link's frame. Ignored for the base.
    pub joint_to_com: [f64; 3],
    /// Unit vector along the hinge, in this link's frame. Ignored for the base.
    pub axis: [f64; 3],
    /// Lateral friction coefficient (–). Bullet multiplies the two of a contact and limits the product to 10.
    pub friction: f64,
    /// Coefficient of restitution (–), from 0 to 1. A contact has the product of its two.
    pub restitution: f64,
    /// Collision margin (cm): rounds the box's edges.
    pub collision_margin: f64,
}

/// A static floor: a box whose upper face is level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ground {
    /// Half the box's edges along x, y, z (cm).
    pub half_extents: [f64; 3],
    /// Height of the upper face (cm).
    pub top: f64,
    /// Lateral friction coefficient (–).
    pub friction: f64,
    /// Coefficient of restitution (–), from 0 to 1.
    pub restitution: f64,
    /// Collision margin (cm).
    pub collision_margin: f64,
}

/// What acts on a body from outside, in the world's axes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C)]
pub struct Wrench {
    /// Force on the centre of mass (dyn).
    pub force: [f64; 3],
    /// Torque (dyn·cm).
    pub torque: [f64; 3],
}

/// A multibody in one particular world.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct BodyId {
    pub(super) world: u64,
    pub(super) index: i32,
}

/// Pose and velocity of a multibody's base, in the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaseState {
    /// Centre of mass (cm).
    pub position: [f64; 3],
    /// Rotation from base to world, as a unit quaternion x, y, z, w.
    pub orientation: [f64; 4],
    /// Velocity of the centre of mass (cm/s).
    pub velocity: [f64; 3],
    /// Angular velocity (rad/s).
    pub angular_velocity: [f64; 3],
}

/// Pose and velocity of a link, as Bullet cached them in the last step: one step older than the joint angles.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LinkState {
    /// Centre of mass (cm), world frame.
    pub position: [f64; 3],
    /// Rotation from link to world, by rows.
    pub rotation: [[f64; 3]; 3],
    /// Velocity of the centre of mass (cm/s), world frame: today's rates in yesterday's rotation, as PyBullet reports it.
    pub velocity: [f64; 3],
    /// Angular velocity (rad/s), world frame, with the same mixture of times.
    pub angular_velocity: [f64; 3],
}

/// One contact point of the last step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// The first body and its link (`None`: the base).
    pub a: (BodyId, Option<usize>),
    /// The second body and its link.
    pub b: (BodyId, Option<usize>),
    /// Where it touches the second body (cm), world frame.
    pub position: [f64; 3],
    /// Unit normal from the second body towards the first.
    pub normal: [f64; 3],
    /// Gap (cm), negative where the boxes overlap.
    pub distance: f64,
    /// Impulse along the normal on the first body in the last step (dyn·s). Divide by the time step for the mean force.
    pub normal_impulse: f64,
    /// Impulses along the two friction directions (dyn·s).
    pub friction_impulse: [f64; 2],
    /// The two friction directions, world frame.
    pub friction_directions: [[f64; 3]; 2],
}

/// The largest generalised velocity of a body beside the value at which Bullet clamps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VelocityClamp {
    /// Bullet's limit for every generalised velocity (cm/s for the base, rad/s for joints).
    pub limit: f64,
    /// Largest magnitude now, in the same mixed units.
    pub largest: f64,
}

impl VelocityClamp {
    /// Whether the clamp has bitten in the last step.
    pub fn hit(&self) -> bool {
        self.largest >= self.limit
    }
}
