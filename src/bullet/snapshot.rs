//! Snapshots of a world.

use bullet_sys as sys;

use super::check::index;
use super::raw::{Message, outcome};
use super::{BulletError, World};

/// Everything that a later step of a world depends on.
///
/// A snapshot fits any world that was built by the same calls in the same order, in this process or another.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    data: Vec<f64>,
}

impl Snapshot {
    /// The snapshot as plain numbers, for storing.
    pub fn as_slice(&self) -> &[f64] {
        &self.data
    }

    /// The snapshot's numbers themselves.
    pub fn into_vec(self) -> Vec<f64> {
        self.data
    }

    /// A snapshot from stored numbers. Whether they fit is checked by [`World::restore`].
    pub fn from_vec(data: Vec<f64>) -> Self {
        Self { data }
    }
}

impl World {
    /// Takes a snapshot: a later [`restore`](Self::restore) continues with the same bits as if nothing had happened between.
    ///
    /// # Errors
    /// [`BulletError::Broken`], or [`BulletError::Internal`].
    pub fn snapshot(&self) -> Result<Snapshot, BulletError> {
        self.usable()?;
        let mut size = 0;
        // SAFETY: the out-pointer is to a live local.
        let code = unsafe { sys::bs_snapshot_size(self.pointer(), &mut size) };
        outcome(code, || "snapshot size".into())?;
        let mut data = vec![0.0; size.unsigned_abs() as usize];
        let mut message = Message::new();
        // SAFETY: `data` holds `size` values; the message's length is its own.
        let code = unsafe { sys::bs_snapshot_take(self.pointer(), data.as_mut_ptr(), size, message.0.as_mut_ptr(), 256) };
        outcome(code, || message.text())?;
        Ok(Snapshot { data })
    }

    /// Puts the world back to a snapshot, its own or that of a world built by the same calls.
    ///
    /// # Errors
    /// [`BulletError::Snapshot`] if it does not fit, with nothing changed.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), BulletError> {
        self.usable()?;
        let length = index(snapshot.data.len())?;
        let mut message = Message::new();
        // SAFETY: the slice holds `length` values, and the shim checks what they say before it uses them.
        let code =
            unsafe { sys::bs_snapshot_restore(self.pointer(), snapshot.data.as_ptr(), length, message.0.as_mut_ptr(), 256) };
        self.checked(code, &message)
    }
}
