#!/usr/bin/env bash
# From a fresh Debian 12 with Rust: installs Bullet, builds sfers, simulates a jump, and proves that the result is the authors'.
set -euo pipefail
cd "$(dirname "$0")/.."

bash scripts/debian.sh build-essential pkg-config libbullet-dev libclang-14-dev
cargo build --release --locked
sfers=target/release/sfers

echo
echo "== Five actuators, the middle three switched off and on 14 times a second, half a second long"
mkdir -p target/demo
"$sfers" preset jump-14hz > target/demo/jump.toml
"$sfers" run target/demo/jump.toml --out target/demo/jump.npz

echo
echo "== The authors' fourteen recordings on PyBullet, compared bit by bit"
"$sfers" crosscheck

echo
echo "== The Python wheel, built and installed into a fresh environment"
bash scripts/wheel.sh
