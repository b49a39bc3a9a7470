//! Raw bindings to a thin C shim over Bullet's float64 multibody dynamics.
//!
//! The interface is `shim/bullet_shim.h`: what each function does, its units, frames and return codes are documented there.
//! Use the safe layer of the `sfers` crate (`sfers::bullet`) instead; this crate only carries the symbols across.

#[allow(missing_docs, non_camel_case_types, clippy::undocumented_unsafe_blocks)]
mod bindings {
    include!(concat!(env!("OUT_DIR"), "/bindings.rs"));
}

pub use bindings::*;
