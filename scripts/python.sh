#!/usr/bin/env bash
# Makes the Python environment of the checks against other simulators: .venv with pybullet 3.2.7, mujoco 4.0.0 and numpy, from PyPI.
# Idempotent.
set -euo pipefail
cd "$(dirname "$0")/.."

if ! .venv/bin/python -c 'import mujoco, numpy, pybullet' 2>/dev/null; then
  echo "python: installing pybullet 3.2.7, mujoco 4.0.0 and numpy into .venv"
  # Debian's Python by preference: PyBullet has wheels for it.
  python=/usr/bin/python3
  [ -x "$python" ] || python=python3
  "$python" -m venv --clear .venv
  .venv/bin/python -m pip install --quiet --disable-pip-version-check pybullet==3.2.7 mujoco==4.0.0 numpy
fi
.venv/bin/python - <<'PYTHON' 2>/dev/null
from importlib.metadata import version
print(f"python: pybullet {version('pybullet')}, mujoco {version('mujoco')}, numpy {version('numpy')} in .venv")
PYTHON
