//! The check that the Bullet library loaded at run time is the one that this crate was built for.

use super::BulletError;

/// What the compiled shim and the loaded library say of themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Facts {
    abi: i32,
    header_scalar_size: i32,
    linked_scalar_size: i32,
    bullet_version: i32,
}

const NEEDED: Facts =
    Facts { abi: bullet_sys::BS_ABI_VERSION, header_scalar_size: 8, linked_scalar_size: 8, bullet_version: 324 };

fn compare(found: Facts) -> Result<(), BulletError> {
    for (what, found, needed) in [
        ("the version of the C interface", found.abi, NEEDED.abi),
        ("the size of a scalar in Bullet's headers, in bytes,", found.header_scalar_size, NEEDED.header_scalar_size),
        ("the size of a scalar in the loaded Bullet library, in bytes,", found.linked_scalar_size, NEEDED.linked_scalar_size),
        ("Bullet's version, times 100,", found.bullet_version, NEEDED.bullet_version),
    ] {
        if found != needed {
            return Err(BulletError::WrongLibrary { what, found: found.into(), needed: needed.into() });
        }
    }
    Ok(())
}

/// Refuses a Bullet of another precision or version. Called by every [`World::new`](super::World::new).
pub(super) fn check() -> Result<(), BulletError> {
    // SAFETY: these four functions take nothing, return an integer and touch no state.
    let found = unsafe {
        Facts {
            abi: bullet_sys::bs_abi_version(),
            header_scalar_size: bullet_sys::bs_scalar_size(),
            linked_scalar_size: bullet_sys::bs_linked_scalar_size(),
            bullet_version: bullet_sys::bs_bullet_version(),
        }
    };
    compare(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_library_of_this_build_is_accepted() {
        assert_eq!(check(), Ok(()));
    }

    #[test]
    fn single_precision_another_version_or_another_interface_is_refused() {
        for wrong in [
            Facts { linked_scalar_size: 4, ..NEEDED },
            Facts { header_scalar_size: 4, ..NEEDED },
            Facts { bullet_version: 325, ..NEEDED },
            Facts { abi: NEEDED.abi + 1, ..NEEDED },
        ] {
            assert!(matches!(compare(wrong), Err(BulletError::WrongLibrary { .. })), "{wrong:?}");
        }
    }
}
