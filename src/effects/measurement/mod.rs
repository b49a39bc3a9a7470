//! Between the robot and what is recorded of it. Seen positions are rolled, scaled, then shifted, and late.

mod camera_tilt;
mod sensor_delay;
mod sensor_offset;
mod sensor_scale;

pub use camera_tilt::CAMERA_TILT;
pub use sensor_delay::SENSOR_DELAY;
pub use sensor_offset::SENSOR_OFFSET;
pub use sensor_scale::SENSOR_SCALE;
