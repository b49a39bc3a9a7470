#!/usr/bin/env bash
# Where pkg-config finds no double-precision Bullet, or one of another version or precision, the build must fail and say why.
set -euo pipefail
cd "$(dirname "$0")/.."

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# expect WORDS: builds bullet-sys with only $folder for pkg-config and looks for WORDS in the error.
expect() {
  local text
  if text=$(PKG_CONFIG_PATH='' PKG_CONFIG_LIBDIR="$folder" cargo build --release --locked -p bullet-sys 2>&1); then
    echo "the build succeeded, but should have failed with: $1"
    exit 1
  fi
  if ! grep -qF "$1" <<< "$text"; then
    printf 'the error does not say: %s\n%s\n' "$1" "$text"
    exit 1
  fi
  echo "refused: $1"
}

# pc VERSION CFLAGS: writes a bullet-float64.pc.
pc() {
  printf 'Name: bullet-float64\nDescription: stand-in\nVersion: %s\nCflags: %s\nLibs: -lBulletDynamics-float64\n' "$1" "$2" \
    > "$folder/bullet-float64.pc"
}

expect 'libbullet-dev'
pc 3.25 -DBT_USE_DOUBLE_PRECISION
expect 'Bullet 3.25 was found'
pc 3.24 ''
expect 'single-precision'
