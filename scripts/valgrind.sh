#!/usr/bin/env bash
# One short run under valgrind's memcheck: no error, no leak that is definite.
#
#   bash scripts/valgrind.sh            with a program built for it
#   bash scripts/valgrind.sh PROGRAM    with this one
set -euo pipefail
cd "$(dirname "$0")/.."

program=${1:-}
if [ -z "$program" ]; then
  cargo build --release --locked
  program=target/release/sfers
fi
"$program" preset jump-14hz |
  valgrind --quiet --error-exitcode=9 --leak-check=full --show-leak-kinds=definite --errors-for-leak-kinds=definite \
    "$program" run - --quiet --set simulation.duration_s=0.002 > /dev/null
echo "valgrind: clean"
