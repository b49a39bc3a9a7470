#!/usr/bin/env bash
# Builds the shim with its C++ test under AddressSanitizer with UndefinedBehaviorSanitizer, then under ThreadSanitizer, and runs both.
# Bullet itself is Debian's library and is not instrumented; its headers, which the shim compiles in, are.
# Usage: scripts/sanitize.sh. Needs g++, pkg-config and libbullet-dev. Output: target/sanitize.
set -euo pipefail
cd "$(dirname "$0")/.."

out=target/sanitize
mkdir -p "$out"
# Bullet's headers are not free of warnings, hence -isystem.
read -ra flags <<<"$(pkg-config --cflags bullet-float64 | sed 's/-I *\([^ ]*\)/-isystem \1/g')"
read -ra libraries <<<"$(pkg-config --libs bullet-float64)"
sources=(bullet-sys/shim/*.cpp bullet-sys/tests/shim.cpp bullet-sys/tests/trees.cpp)

build() { # name, then the sanitizer's flags
  local name=$1
  shift
  g++ -std=c++17 -O1 -g -fno-omit-frame-pointer -ffp-contract=off -Wall -Wextra -Werror "$@" "${flags[@]}" "${sources[@]}" \
    -o "$out/$name" "${libraries[@]}" -ldl -pthread
}

build address -fsanitize=address,undefined -fno-sanitize-recover=all &
build thread -fsanitize=thread &
wait -n
wait -n

echo "address and undefined behaviour:"
ASAN_OPTIONS=detect_leaks=1:strict_init_order=1 UBSAN_OPTIONS=print_stacktrace=1 "$out/address"

echo "threads:"
# ThreadSanitizer cannot map its shadow under some kernels' address randomisation: then without that.
if ! TSAN_OPTIONS=halt_on_error=1 "$out/thread" >"$out/thread.log" 2>&1; then
  if ! grep -q "unexpected memory mapping" "$out/thread.log"; then
    cat "$out/thread.log"
    exit 1
  fi
  TSAN_OPTIONS=halt_on_error=1 setarch "$(uname -m)" -R "$out/thread" >"$out/thread.log" 2>&1 || {
    cat "$out/thread.log"
    exit 1
  }
fi
cat "$out/thread.log"
