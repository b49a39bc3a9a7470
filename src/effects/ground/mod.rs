//! Contact between robot and ground.

mod contact_restitution;
mod free_floor_friction;
mod ground_friction;
mod ground_slope;
mod stick_slip;

pub use contact_restitution::CONTACT_RESTITUTION;
pub use free_floor_friction::FREE_FLOOR_FRICTION;
pub use ground_friction::GROUND_FRICTION;
pub use ground_slope::GROUND_SLOPE;
pub use stick_slip::STICK_SLIP;
