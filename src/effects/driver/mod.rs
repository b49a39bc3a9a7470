//! Between the commanded and the applied voltage.

mod driver_lag;
mod follower;
mod saturation;
mod slew_limit;
mod time_delay;

pub use driver_lag::DRIVER_LAG;
pub use saturation::SATURATION;
pub use slew_limit::SLEW_LIMIT;
pub use time_delay::TIME_DELAY;
