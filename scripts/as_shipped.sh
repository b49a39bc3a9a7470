#!/usr/bin/env bash
# The shim's own rows and sweeps against Bullet's as Debian ships it: the same bytes.
#
# Recordings are compared as CSV, all digits of them: an NPZ holds the minute of its making.
#   bash scripts/as_shipped.sh                  the second program is built in target/as-shipped and stays there, for scripts/bench_engines.py too
#   bash scripts/as_shipped.sh --unoptimised    its own crate is built without optimisation, which changes no bits and saves minutes: for this comparison only; the first
#                                               program is target/release/sfers as it is, and is put back afterwards
set -euo pipefail
cd "$(dirname "$0")/.."

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

build() { cargo build --release --locked --bin sfers "$@"; }
if [ "${1:-}" = --unoptimised ]; then
  cp target/release/sfers "$folder/own"
  # In the same folder, where other crates are built already.
  build --features bullet-as-shipped --config 'profile.release.package.sfers-rs.opt-level=0'
  mv target/release/sfers "$folder/shipped"
  cp "$folder/own" target/release/sfers
else
  build
  cp target/release/sfers "$folder/own"
  build --features bullet-as-shipped --target-dir target/as-shipped
  cp target/as-shipped/release/sfers "$folder/shipped"
fi
if cmp --quiet "$folder/own" "$folder/shipped"; then
  echo "both programs are the same: nothing to compare"
  exit 1
fi
for preset in cantilever-dc jump-14hz full-frictional-inchworm; do
  for program in own shipped; do
    "$folder/$program" preset "$preset" \
      | "$folder/$program" run - --quiet --set simulation.engine=bullet --set simulation.duration_s=0.1 --out "$folder/$program.csv" > /dev/null
  done
  cmp "$folder/own.csv" "$folder/shipped.csv"
  echo "$preset: the same bytes"
done
