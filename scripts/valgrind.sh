#!/usr/bin/env bash
# One short run under valgrind's memcheck: no error, no leak that is definite.
set -euo pipefail
cd "$(dirname "$0")/.."

cargo build --release --locked
target/release/sfers preset jump-14hz |
  valgrind --quiet --error-exitcode=9 --leak-check=full --show-leak-kinds=definite --errors-for-leak-kinds=definite \
    target/release/sfers run - --quiet --set simulation.duration_s=0.002 > /dev/null
echo "valgrind: clean"
