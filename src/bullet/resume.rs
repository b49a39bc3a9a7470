//! A world's state as PyBullet's `saveBullet` keeps it.

use bullet_sys as sys;

use super::check::index;
use super::raw::{Message, outcome};
use super::{BulletError, World};

impl World {
    /// What PyBullet saves: poses, angles, rates and contact points, as plain numbers. A world that is resumed from it has PyBullet's bits after
    /// `restoreState`; to go on as if nothing had happened, take a [`snapshot`](Self::snapshot).
    ///
    /// # Errors
    /// [`BulletError::Broken`], or [`BulletError::Internal`].
    pub fn saved(&self) -> Result<Vec<f64>, BulletError> {
        self.usable()?;
        let mut size = 0;
        // SAFETY: the out-pointer is to a live local.
        let code = unsafe { sys::bs_resume_size(self.pointer(), &mut size) };
        outcome(code, || "size of a saved world".into())?;
        let mut data = vec![0.0; size.unsigned_abs() as usize];
        let mut message = Message::new();
        // SAFETY: `data` holds `size` values; the message's length is its own.
        let code = unsafe { sys::bs_resume_take(self.pointer(), data.as_mut_ptr(), size, message.0.as_mut_ptr(), 256) };
        outcome(code, || message.text())?;
        Ok(data)
    }

    /// Resumes from what [`saved`](Self::saved) gave, of this world or of one built by the same calls.
    ///
    /// # Errors
    /// [`BulletError::Snapshot`] if it does not fit, with nothing changed.
    pub fn resume(&mut self, saved: &[f64]) -> Result<(), BulletError> {
        self.usable()?;
        let length = index(saved.len())?;
        let mut message = Message::new();
        // SAFETY: the slice holds `length` values, and the shim checks what they say before it uses them.
        let code = unsafe { sys::bs_resume_from(self.pointer(), saved.as_ptr(), length, message.0.as_mut_ptr(), 256) };
        self.checked(code, &message)
    }
}
