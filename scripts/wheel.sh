#!/usr/bin/env bash
# Builds the Python package's wheel into target/wheel, with Debian's Bullet and all licences in it, and installs it into a fresh environment, target/wheel-python.
#
#   bash scripts/wheel.sh          that, and its first steps there
#   bash scripts/wheel.sh --test   besides: all tests of the package in .venv, its stubs and types, its notebooks, its reference as HTML in target/python-reference
set -euo pipefail
cd "$(dirname "$0")/.."

bash scripts/debian.sh build-essential pkg-config libbullet-dev libclang-14-dev python3 python3-venv
tests=false
if [ "${1:-}" = --test ]; then tests=true; fi
bash scripts/python.sh $($tests || echo build)
export PATH="$PWD/.venv/bin:$PATH" VIRTUAL_ENV="$PWD/.venv"

rm -rf target/wheel target/wheel-python python/licences
python scripts/licences.py python/licences
maturin build --quiet --release --locked --manifest-path python/Cargo.toml --out target/wheel
wheel=$(echo target/wheel/*.whl)
size=$(stat --format=%s "$wheel")
echo "wheel: $wheel, $((size / 1024)) KiB"
[ "$size" -le $((15 * 1024 * 1024)) ] || { echo "wheel: more than 15 MiB"; exit 1; }

/usr/bin/python3 -m venv target/wheel-python
target/wheel-python/bin/python -m pip install --quiet --disable-pip-version-check "$wheel"
(cd target && wheel-python/bin/python ../python/tests/first_steps.py)

if $tests; then
  .venv/bin/python -m pip install --quiet --disable-pip-version-check --force-reinstall --no-deps "$wheel"
  .venv/bin/python -m mypy.stubtest sfers_rs._native
  (cd target && ../.venv/bin/python -m mypy --package sfers_rs)
  (cd python/tests && ../../.venv/bin/python -m pytest --quiet --no-header --numprocesses 2 --dist worksteal -p no:cacheprovider .)
  .venv/bin/python -m pdoc --output-directory target/python-reference sfers_rs 2>/dev/null
fi
