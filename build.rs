//! Records Bullet's version and precision, and the git revision, for the manifest of every result.

use std::env;
use std::path::Path;
use std::process::Command;

fn main() {
    for (name, metadata) in
        [("SFERS_BULLET_VERSION", "DEP_BULLET_FLOAT64_VERSION"), ("SFERS_BULLET_PRECISION", "DEP_BULLET_FLOAT64_PRECISION")]
    {
        let value = env::var(metadata).unwrap_or_else(|_| "unknown".into());
        println!("cargo::rustc-env={name}={value}");
    }
    println!("cargo::rustc-env=SFERS_GIT_REVISION={}", git_revision());
    println!("cargo::rerun-if-changed=build.rs");
    for path in [".git/HEAD", ".git/logs/HEAD"] {
        if Path::new(path).exists() {
            println!("cargo::rerun-if-changed={path}");
        }
    }
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
