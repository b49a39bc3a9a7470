//! What can go wrong between this crate and Bullet.

use thiserror::Error;

/// An error of the Bullet layer.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum BulletError {
    /// The Bullet library found at run time is not the one that this program was built for.
    #[error("{what} is {found}, but this program needs {needed}; install Debian 12's libbullet-dev and rebuild")]
    WrongLibrary {
        /// The fact that was compared.
        what: &'static str,
        /// What the loaded library or the compiled shim says.
        found: i64,
        /// What this crate was written for.
        needed: i64,
    },
    /// A body id that another [`World`](super::World) handed out.
    #[error("the body id belongs to another world")]
    ForeignBody,
    /// An array whose length does not fit the body.
    #[error("{what} has {found} values, but this body takes {needed}")]
    Length {
        /// The array.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length that fits.
        needed: usize,
    },
    /// A value that Bullet cannot take: not finite, or outside its range.
    #[error("{what} is {}, but must be {needed}", crate::words::number(*.value))]
    Value {
        /// The argument.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The range that is accepted.
        needed: &'static str,
    },
    /// The world failed in an earlier call and cannot be used further.
    #[error("this world failed in an earlier call and cannot be used further; build a new one")]
    Broken,
    /// The shim refused a call; the message is the shim's.
    #[error("Bullet refused: {0}")]
    Refused(String),
    /// A snapshot of a world that is built differently.
    #[error("the snapshot does not belong to a world of this make-up: {0}")]
    Snapshot(String),
    /// An allocation failed or an exception came out of Bullet; the world is [`Broken`](Self::Broken) from now on.
    #[error("Bullet failed: {0}; please report this")]
    Internal(String),
}
