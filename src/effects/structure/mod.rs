//! Mounting and structure: clamp, added mass, shape, stiffness and losses.

mod air_drag;
mod cable_drag;
mod clamp_compliance;
mod clamp_shift;
mod dry_friction;
mod free_clamp;
mod free_drag;
mod free_joint_memory;
mod free_joint_slip;
mod free_mass;
mod free_moment_of_deviation;
mod free_moment_of_rate;
mod free_stiffness_along;
mod initial_curvature;
mod stiffness_drift;
mod stiffness_softening;
mod structural_damping;
mod tip_mass;

pub use air_drag::AIR_DRAG;
pub use cable_drag::CABLE_DRAG;
pub use clamp_compliance::CLAMP_COMPLIANCE;
pub use clamp_shift::CLAMP_SHIFT;
pub use dry_friction::DRY_FRICTION;
pub use free_clamp::FREE_CLAMP;
pub use free_drag::FREE_DRAG;
pub use free_joint_memory::FREE_JOINT_MEMORY;
pub use free_joint_slip::FREE_JOINT_SLIP;
pub use free_mass::FREE_MASS;
pub use free_moment_of_deviation::FREE_MOMENT_OF_DEVIATION;
pub use free_moment_of_rate::FREE_MOMENT_OF_RATE;
pub use free_stiffness_along::FREE_STIFFNESS_ALONG;
pub use initial_curvature::INITIAL_CURVATURE;
pub use stiffness_drift::STIFFNESS_DRIFT;
pub use stiffness_softening::STIFFNESS_SOFTENING;
pub use structural_damping::STRUCTURAL_DAMPING;
pub use tip_mass::TIP_MASS;
