//! Mounting and structure: clamp, added mass, shape, stiffness and losses.

mod air_drag;
mod clamp_compliance;
mod dry_friction;
mod initial_curvature;
mod stiffness_softening;
mod structural_damping;
mod tip_mass;

pub use air_drag::AIR_DRAG;
pub use clamp_compliance::CLAMP_COMPLIANCE;
pub use dry_friction::DRY_FRICTION;
pub use initial_curvature::INITIAL_CURVATURE;
pub use stiffness_softening::STIFFNESS_SOFTENING;
pub use structural_damping::STRUCTURAL_DAMPING;
pub use tip_mass::TIP_MASS;
