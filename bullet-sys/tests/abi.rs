//! The bindings and the compiled shim agree on versions, sizes and offsets.

use std::mem::{offset_of, size_of};

use bullet_sys::{BS_ABI_VERSION, bs_contact, bs_link, bs_settings, bs_tree_body};

#[test]
fn structures_have_the_layout_that_the_compiler_of_the_shim_sees() {
    let mut sizes = [0; 8];
    // SAFETY: the call writes at most 8 values.
    unsafe { bullet_sys::bs_layout(sizes.as_mut_ptr(), 8) };
    let here = [
        size_of::<bs_settings>(),
        size_of::<bs_link>(),
        size_of::<bs_contact>(),
        size_of::<bs_tree_body>(),
        offset_of!(bs_settings, reserved),
        offset_of!(bs_link, reserved),
        offset_of!(bs_contact, link_b),
        offset_of!(bs_tree_body, reserved),
    ];
    assert_eq!(sizes.map(|size| usize::try_from(size).unwrap()), here);
}

#[test]
fn versions_and_precision_are_those_of_the_header() {
    // SAFETY: these calls take nothing and touch no state.
    unsafe {
        assert_eq!(bullet_sys::bs_abi_version(), BS_ABI_VERSION);
        assert_eq!(bullet_sys::bs_scalar_size(), 8);
        assert_eq!(bullet_sys::bs_linked_scalar_size(), 8);
        assert_eq!(bullet_sys::bs_bullet_version(), 324);
    }
}

#[test]
fn a_null_pointer_is_an_error_code_with_a_message() {
    let mut message = [0; 64];
    // SAFETY: the shim checks for null; the message's length is its own.
    let code = unsafe { bullet_sys::bs_world_create(std::ptr::null(), std::ptr::null_mut(), message.as_mut_ptr(), 64) };
    assert_eq!(code, bullet_sys::BS_ERROR_ARGUMENT);
    assert_ne!(message[0], 0);
}
