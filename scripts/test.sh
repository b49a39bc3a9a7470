#!/usr/bin/env bash
# All set-up and all tests, on a fresh Debian 12 with Rust.
#
#   bash scripts/test.sh          all tests, those that `cargo test` leaves out as slow and those against PyBullet, MuJoCo and Chromium among them
#   bash scripts/test.sh --long   besides: the shim under sanitizers, its bytes against Bullet's as shipped, a run under valgrind, the
#                                 whole reproduction of the paper (some minutes), the refusal of a machine without Bullet
#   bash scripts/test.sh --hidden besides the first: every effect hidden in data and looked for, 200 random experiments, 40 robots on films
#
# CI sets CI=true, which means --long.
set -euo pipefail
cd "$(dirname "$0")/.."

long=false
if [ "${1:-}" = --long ] || [ "${CI:-}" = true ]; then long=true; fi
export SFERS_LONG=0
if [ "${1:-}" = --hidden ]; then SFERS_LONG=1; fi
packages=(build-essential pkg-config libbullet-dev libclang-14-dev python3 python3-venv chromium slurmctld slurmd slurm-client munge)
if $long; then packages+=(valgrind); fi
bash scripts/debian.sh "${packages[@]}"
bash scripts/python.sh

step() { printf '\n== %s (after %d s)\n' "$*" "$SECONDS"; }

step "tests"
# A missing tool is an error here, not a skipped test.
export SFERS_REQUIRE_TOOLS=1 SFERS_FUZZ_INPUTS=20000
# No test reads line tables, which take minutes to write; the instructions are the same.
export CARGO_PROFILE_RELEASE_DEBUG=none
# The two left out are no tests: a worker of the fuzz tests, and the repetition of one input.
cargo test --release --locked --workspace -- --include-ignored --skip worker_process --skip one_case

step "the Python package: wheel, types, tests, notebooks"
bash scripts/wheel.sh --test

if $long; then
  # As the tests have built it: another build would choose other features of a few crates, and take minutes.
  program=target/release/sfers
  step "shim under ASan, UBSan and TSan"
  bash scripts/sanitize.sh
  step "the shim's rows against Bullet's own"
  bash scripts/as_shipped.sh --unoptimised
  step "one short run under valgrind"
  bash scripts/valgrind.sh "$program"
  step "the whole paper"
  "$program" reproduce --quick --out target/paper
  step "a build without Bullet names the Debian package"
  bash scripts/no_bullet.sh
fi
step "all passed"
