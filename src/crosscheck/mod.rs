//! One-to-one with the reference: the same experiment here and there, compared bit by bit.
//!
//! "There" is a recording, a live PyBullet that is driven by a script of this program, or the authors' own classes. Joint angles,
//! rates and torques must have equal bits; times and voltages too. Node positions may differ by 10⁻⁵ cm: PyBullet computes the
//! frames of links in single precision. Velocities of nodes may differ by 10⁻⁴ cm/s (see [`VELOCITY_TOLERANCE`]).

mod builtin;
mod compare;
mod engines;
mod python;

pub use builtin::{BUILTIN, Builtin};
pub use compare::{Difference, FAR, Quantity, Report, compare};
pub use engines::{ENGINE_SET, EngineReport, EngineVerdict, MeasurePair, PARTED, Parting, compare_engines};
pub use python::{AuthorsRun, CrosscheckError, Versions, authors_run, run_authors, run_pybullet};

/// How far positions of nodes may differ (cm), for robots up to 50 cm long, the reference's size; in proportion beyond.
///
/// PyBullet rounds a link's position and then its frame's to single precision, and the right end adds to that: three roundings of
/// half a unit in the last place, which is 1.9·10⁻⁶ cm between 32 and 64 cm and 3.8·10⁻⁶ cm between 64 and 128 cm. The rest is for
/// the ends' pitch, as under [`VELOCITY_TOLERANCE`].
pub const POSITION_TOLERANCE: f64 = 1e-5;

/// How far velocities of nodes may differ (cm/s). The right end's velocity is turned by a lever of up to 5 cm and a rate of up to
/// 100 rad/s (Bullet's clamp), and PyBullet takes the lever's direction from an orientation in single precision, which is off by
/// 2⁻²⁴ rad: 3·10⁻⁵ cm/s. Measured on the fourteen recordings: at most 1.6·10⁻⁵ cm/s.
pub const VELOCITY_TOLERANCE: f64 = 1e-4;
