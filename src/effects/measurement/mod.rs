//! Between the robot and its record: positions are delayed, rolled, scaled, shifted, then bent.

mod camera_tilt;
mod free_picture;
mod sensor_delay;
mod sensor_offset;
mod sensor_scale;

pub use camera_tilt::CAMERA_TILT;
pub use free_picture::FREE_PICTURE;
pub use sensor_delay::SENSOR_DELAY;
pub use sensor_offset::SENSOR_OFFSET;
pub use sensor_scale::SENSOR_SCALE;
