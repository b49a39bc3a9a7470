"""What the tests share. Their own modules are importable, in other processes too."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RECORDINGS = ROOT / "tests" / "recordings"

# What the tests start hears Ctrl-C, even where they themselves were started with it ignored, as in the background of a script.
signal.signal(signal.SIGINT, signal.default_int_handler)

HERE = str(Path(__file__).parent)
sys.path.insert(0, HERE)
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [HERE, os.environ.get("PYTHONPATH")]))


def missing(what: str) -> None:
    """Skips a test that needs `what`, or fails it where all tools must be there."""
    if os.environ.get("SFERS_REQUIRE_TOOLS") == "1":
        pytest.fail(f"{what} is missing")
    pytest.skip(f"{what} is missing")


@pytest.fixture(scope="session")
def pybullet_python() -> str:
    """A Python that has PyBullet."""
    python = os.environ.get("SFERS_PYBULLET_PYTHON", str(ROOT / ".venv" / "bin" / "python"))
    if not Path(python).exists() or subprocess.run([python, "-c", "import pybullet"], capture_output=True).returncode:
        missing("PyBullet (set SFERS_PYBULLET_PYTHON)")
    return python
