//! Refuses targets that nothing is tested on, and records Bullet's version and the git revision for the manifest of every result.

use std::env;
use std::path::Path;
use std::process::Command;

fn main() {
    refuse_other_targets();
    println!("cargo::rustc-env=SFERS_BULLET={}", bullet());
    println!("cargo::rustc-env=SFERS_GIT_REVISION={}", git_revision());
    println!("cargo::rerun-if-changed=build.rs");
    for path in [".git/HEAD", ".git/logs/HEAD"] {
        if Path::new(path).exists() {
            println!("cargo::rerun-if-changed={path}");
        }
    }
}

/// Recordings, states and contact arithmetic are tested with 64-bit little-endian words only.
fn refuse_other_targets() {
    let target = |what: &str| env::var(format!("CARGO_CFG_TARGET_{what}")).unwrap_or_default();
    if target("POINTER_WIDTH") != "64" || target("ENDIAN") != "little" {
        println!(
            "cargo::error=sfers needs a 64-bit little-endian target, and {} is none",
            env::var("TARGET").unwrap_or_default()
        );
        std::process::exit(1);
    }
}

/// Version and precision as the build script of bullet-sys found them.
fn bullet() -> String {
    if env::var_os("CARGO_FEATURE_BULLET").is_none() {
        return "not built".into();
    }
    let found = |what: &str| env::var(format!("DEP_BULLET_FLOAT64_{what}")).unwrap_or_else(|_| "unknown".into());
    format!("{} {}", found("VERSION"), found("PRECISION"))
}

/// The commit, or `unknown` outside a git checkout.
fn git_revision() -> String {
    Command::new("git")
        .args(["rev-parse", "HEAD"])
        .output()
        .ok()
        .filter(|output| output.status.success())
        .and_then(|output| String::from_utf8(output.stdout).ok())
        .map_or_else(|| "unknown".into(), |text| text.trim().to_owned())
}
