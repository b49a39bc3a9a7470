#!/usr/bin/env bash
# Inputs of every kind that the program reads, damaged and sound, until one goes wrong or all are given (tests/fuzz.rs).
#
#   bash scripts/fuzz.sh [INPUTS [SEED]]    1,000,000 inputs of seed 1 by default: about 20 minutes on two processors
#
# Prints a table (kind, inputs, accepted, refused, seconds, largest memory, longest input) and ends with code 0 if nothing went wrong.
set -euo pipefail
cd "$(dirname "$0")/.."
export SFERS_FUZZ_INPUTS="${1:-1000000}" SFERS_FUZZ_SEED="${2:-1}"
cargo test --release --locked --test fuzz no_input -- --nocapture
