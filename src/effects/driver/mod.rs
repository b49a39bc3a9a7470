//! Between the commanded and the applied voltage.

mod driver_lag;
mod follower;
mod free_drive_filter;
mod lags;
mod saturation;
mod slew_limit;
mod time_delay;

pub use driver_lag::DRIVER_LAG;
pub use free_drive_filter::FREE_DRIVE_FILTER;
pub(super) use lags::Lags;
pub use saturation::SATURATION;
pub use slew_limit::SLEW_LIMIT;
pub use time_delay::TIME_DELAY;
