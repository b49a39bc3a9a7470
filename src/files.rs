//! What all output files have in common.

use std::fs::File;
use std::io;

/// Makes a temporary file, which is private, as readable as any file the user makes.
#[cfg(unix)]
pub(crate) fn make_readable(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

/// As above; elsewhere files inherit their folder's rights.
#[cfg(not(unix))]
pub(crate) fn make_readable(_: &File) -> io::Result<()> {
    Ok(())
}
