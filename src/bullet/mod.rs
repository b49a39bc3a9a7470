//! A safe layer over Bullet's float64 multibody dynamics.
//!
//! A [`World`] holds multibodies of boxes on hinges, at most one static [`Ground`] or several, and constraints. Bodies are named
//! by [`BodyId`]s, arrays of joint values travel whole, and every misuse is a [`BulletError`]. The step itself, the contacts and
//! their impulses are Bullet's.
//!
//! [`World::add_tree`] makes bodies the way PyBullet's calls do, with frames, fixed joints and motors.
//!
//! Units are CGS throughout. Several of Bullet's constants are plain numbers whose meaning changes with the unit: the velocity
//! clamp of 100 is 1 m/s for a base and 100 rad/s for a joint, and contacts are kept to a distance of 0.02 cm.
//!
//! # Examples
//! A box falls for a millisecond:
//! ```
//! use sfers::bullet::{BoxLink, SolverSettings, World};
//! let mut world = World::new(&SolverSettings::pybullet(980.0))?;
//! let cube = BoxLink {
//!     parent: None, mass: 1.0, inertia: None, half_extents: [0.5; 3], com_to_box: [0.0; 3], parent_com_to_joint: [0.0; 3],
//!     joint_to_com: [0.0; 3], axis: [0.0, 1.0, 0.0], friction: 0.5, restitution: 0.0, collision_margin: 0.001,
//! };
//! let body = world.add_multibody(&cube, &[], [0.0, 0.0, 10.0])?;
//! for _ in 0..10 {
//!     world.step(1e-4)?;
//! }
//! let fallen = 10.0 - world.base_state(body)?.position[2];
//! // Semi-implicit Euler: g h² n (n + 1) / 2.
//! assert!((fallen - 980.0 * 1e-8 * 55.0).abs() < 1e-12);
//! # Ok::<(), sfers::bullet::BulletError>(())
//! ```

mod body;
mod check;
mod error;
mod library;
mod raw;
mod resume;
mod settings;
mod snapshot;
mod state;
mod tree;
mod world;

pub use body::{BaseState, BodyId, BoxLink, Contact, Ground, LinkState, VelocityClamp, Wrench};
pub use error::BulletError;
pub use settings::SolverSettings;
pub use snapshot::Snapshot;
pub use tree::{LinkReading, Pose, TreeBody, TreeBox, TreeJoint};
pub use world::World;
