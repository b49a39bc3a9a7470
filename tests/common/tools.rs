//! Programs that some tests need besides this one. Without them a test is skipped, with one line on standard error; where
//! `SFERS_REQUIRE_TOOLS=1` is set, as in `scripts/test.sh`, it fails.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A Python with these modules: `SFERS_PYTHON`, or the environment that `scripts/python.sh` makes.
pub fn python(test: &str, modules: &[&str]) -> Option<PathBuf> {
    let chosen = std::env::var_os("SFERS_PYTHON").map(PathBuf::from);
    let python = chosen.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join(".venv/bin/python"));
    if runs(Command::new(&python).args(["-c", &format!("import {}", modules.join(", "))])) {
        return Some(python);
    }
    skip(test, &format!("{} with {}", python.display(), modules.join(" and ")), "scripts/python.sh");
    None
}

pub fn chromium(test: &str) -> Option<Command> {
    if runs(Command::new("chromium").arg("--version")) {
        return Some(Command::new("chromium"));
    }
    skip(test, "chromium", "scripts/debian.sh chromium");
    None
}

/// True if a command of Debian's `packages` is there.
#[allow(dead_code)]
pub fn has_command(test: &str, command: &str, packages: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let there = std::env::split_paths(&path).any(|folder| folder.join(command).is_file());
    if !there {
        skip(test, command, &format!("scripts/debian.sh {packages}"));
    }
    there
}

fn runs(command: &mut Command) -> bool {
    let status = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

fn skip(test: &str, missing: &str, script: &str) {
    let line = format!("{test}: {missing} is missing; bash {script} installs it");
    assert!(!std::env::var("SFERS_REQUIRE_TOOLS").is_ok_and(|value| value == "1"), "{line}");
    // Not `eprintln!`, which the test harness captures.
    let _ = writeln!(std::io::stderr(), "skipped {line}");
}
