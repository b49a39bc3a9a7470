//! The C++ object, the buffer of the shim's messages, and its codes.

use std::ffi::{CStr, c_char};
use std::ptr::NonNull;

use bullet_sys as sys;

use super::BulletError;

/// The only owner of the C++ object.
pub(super) struct RawWorld(pub(super) NonNull<sys::bs_world>);

impl Drop for RawWorld {
    fn drop(&mut self) {
        // SAFETY: the pointer came from bs_world_create, is freed nowhere else, and this owner is gone after this call.
        unsafe { sys::bs_world_destroy(self.0.as_ptr()) }
    }
}

// SAFETY: a bs_world holds no thread-local state and no pointer into the thread that made it. Bullet's process-wide variables are
// only read while stepping, save for debug counters that nothing reads back; gDbvtMargin is written once, under call_once. So a
// world may move to another thread. It is not Sync: reading link velocities uses scratch inside the C++ object.
unsafe impl Send for RawWorld {}

/// A buffer that the shim writes its message to.
pub(super) struct Message(pub(super) [c_char; 256]);

impl Message {
    pub(super) fn new() -> Self {
        Self([0; 256])
    }

    pub(super) fn text(&self) -> String {
        let bytes = self.0.map(|c| c.cast_unsigned());
        CStr::from_bytes_until_nul(&bytes).map(|text| text.to_string_lossy().into_owned()).unwrap_or_default()
    }
}

/// A code of the shim as a result.
pub(super) fn outcome(code: i32, message: impl FnOnce() -> String) -> Result<(), BulletError> {
    match code {
        sys::BS_OK => Ok(()),
        sys::BS_ERROR_ARGUMENT => Err(BulletError::Refused(message())),
        sys::BS_ERROR_SNAPSHOT => Err(BulletError::Snapshot(message())),
        _ => Err(BulletError::Internal(message())),
    }
}
