#!/usr/bin/env bash
# Makes the Python environment of the live PyBullet check: .venv with pybullet 3.2.7 and numpy, from PyPI. Idempotent.
set -euo pipefail
cd "$(dirname "$0")/.."

if ! .venv/bin/python -c 'import numpy, pybullet' 2>/dev/null; then
  echo "python: installing pybullet 3.2.7 and numpy into .venv"
  # Debian's Python by preference: PyBullet has wheels for it.
  python=/usr/bin/python3
  [ -x "$python" ] || python=python3
  "$python" -m venv --clear .venv
  .venv/bin/python -m pip install --quiet --disable-pip-version-check pybullet==3.2.7 numpy
fi
.venv/bin/python - <<'PYTHON' 2>/dev/null
from importlib.metadata import version
print(f"python: pybullet {version('pybullet')}, numpy {version('numpy')} in .venv")
PYTHON
