//! Finds Debian's float64 Bullet, compiles the shim over it and binds the shim's header.

use std::env;
use std::path::{Path, PathBuf};

/// The only Bullet that the shim is written for: snapshots reach into its data structures.
const BULLET_VERSION: &str = "3.24";
const DEBIAN_PACKAGE: &str = "libbullet-dev";
const SOURCES: [&str; 10] = [
    "world.cpp",
    "multibody.cpp",
    "tree.cpp",
    "reading.cpp",
    "resume.cpp",
    "contact.cpp",
    "snapshot.cpp",
    "chain.cpp",
    "fixed.cpp",
    "solver.cpp",
];
const HEADERS: [&str; 8] =
    ["bullet_shim.h", "internal.h", "building.h", "snapshot_state.h", "chain.h", "fixed.h", "solver.h", "impulse.h"];

fn main() {
    refuse_other_targets();
    let bullet = find_bullet();
    compile_shim(&bullet);
    bind_header();
    // Read by the build script of the crate that depends on this one, as DEP_BULLET_FLOAT64_VERSION and so on.
    println!("cargo::metadata=version={}", bullet.version);
    println!("cargo::metadata=precision=float64");
}

/// Snapshots hold indices and flags as doubles, and the layout of Bullet's structures is tested with 64-bit little-endian words only.
fn refuse_other_targets() {
    let target = |what: &str| env::var(format!("CARGO_CFG_TARGET_{what}")).unwrap_or_default();
    if target("POINTER_WIDTH") != "64" || target("ENDIAN") != "little" {
        fail(&format!("the shim needs a 64-bit little-endian target, and {} is none", env::var("TARGET").unwrap_or_default()));
    }
}

/// Asks pkg-config for the double-precision libraries. Plain `bullet` is single precision.
fn find_bullet() -> pkg_config::Library {
    let found = pkg_config::Config::new().cargo_metadata(false).probe("bullet-float64");
    let library = found.unwrap_or_else(|error| {
        fail(&format!(
            "the double-precision Bullet libraries were not found: install the Debian package {DEBIAN_PACKAGE} \
             (apt-get install {DEBIAN_PACKAGE} pkg-config), or point PKG_CONFIG_PATH at the folder of bullet-float64.pc\n{error}"
        ))
    });
    if library.version != BULLET_VERSION {
        fail(&format!(
            "Bullet {} was found, but this shim is written for {BULLET_VERSION} (Debian 12's {DEBIAN_PACKAGE})",
            library.version
        ));
    }
    if !library.defines.contains_key("BT_USE_DOUBLE_PRECISION") {
        fail("bullet-float64.pc does not define BT_USE_DOUBLE_PRECISION: this is a single-precision Bullet");
    }
    // The soft-body library is listed by the .pc file but nothing here uses it.
    for path in &library.link_paths {
        println!("cargo::rustc-link-search=native={}", path.display());
    }
    library
}

fn compile_shim(bullet: &pkg_config::Library) {
    let mut build = cc::Build::new();
    build.cpp(true).std("c++17").opt_level(2).flag("-ffp-contract=off").flag("-fvisibility=hidden");
    // Bullet's own headers are not free of warnings.
    for path in &bullet.include_paths {
        if path != Path::new("/usr/include") {
            build.flag("-isystem").flag(path);
        }
    }
    for (name, value) in &bullet.defines {
        build.define(name, value.as_deref());
    }
    if env::var_os("CARGO_FEATURE_AS_SHIPPED").is_some() {
        build.define("BULLET_SHIM_AS_SHIPPED", None);
    }
    for source in SOURCES {
        let path = format!("shim/{source}");
        println!("cargo::rerun-if-changed={path}");
        build.file(path);
    }
    for header in HEADERS {
        println!("cargo::rerun-if-changed=shim/{header}");
    }
    build.compile("bullet_shim");
    // After the shim, which refers to them.
    for library in bullet.libs.iter().filter(|name| !name.contains("SoftBody")) {
        println!("cargo::rustc-link-lib=dylib={library}");
    }
}

fn bind_header() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    bindgen::Builder::default()
        .header("shim/bullet_shim.h")
        .allowlist_item("(bs|BS)_.*")
        .default_macro_constant_type(bindgen::MacroTypeVariation::Signed)
        .generate_comments(false)
        .layout_tests(true)
        .generate()
        .unwrap_or_else(|error| {
            fail(&format!("bindgen could not read the shim's header (Debian package libclang-14-dev): {error}"))
        })
        .write_to_file(out.join("bindings.rs"))
        .unwrap_or_else(|error| fail(&format!("the bindings could not be written: {error}")));
}

/// Ends the build with a message that stands by itself, without a panic's noise.
fn fail(message: &str) -> ! {
    println!("cargo::error={}", message.replace('\n', " "));
    std::process::exit(1);
}
