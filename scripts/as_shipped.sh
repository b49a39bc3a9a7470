#!/usr/bin/env bash
# The shim's own rows and sweeps against Bullet's as Debian ships it: the same bytes.
#
# Recordings are compared as CSV, all digits of them: an NPZ holds the minute of its making.
#   bash scripts/as_shipped.sh                  the second program is built in target/as-shipped and stays there, for scripts/bench_engines.py too
#   bash scripts/as_shipped.sh --unoptimised    it is built without optimisation, which changes no bits and saves minutes: for this comparison only
set -euo pipefail
cd "$(dirname "$0")/.."

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

cargo build --release --locked --bin sfers
as_shipped=target/as-shipped
if [ "${1:-}" = --unoptimised ]; then
  as_shipped=target/as-shipped-unoptimised
  export CARGO_PROFILE_RELEASE_OPT_LEVEL=0 CARGO_PROFILE_RELEASE_DEBUG=0
fi
cargo build --release --locked --bin sfers --features bullet-as-shipped --target-dir "$as_shipped"
for preset in cantilever-dc jump-14hz full-frictional-inchworm; do
  for build in target/release "$as_shipped/release"; do
    "$build/sfers" preset "$preset" \
      | "$build/sfers" run - --quiet --set simulation.engine=bullet --set simulation.duration_s=0.1 --out "$folder/out.csv" > /dev/null
    mv "$folder/out.csv" "$folder/$(echo "$build" | tr / -).csv"
  done
  cmp "$folder/target-release.csv" "$folder/$(echo "$as_shipped" | tr / -)-release.csv"
  echo "$preset: the same bytes"
done
