"""Ten thousand random calls of the API: exceptions, but no crash and no hang."""

import re
import subprocess
import sys
from pathlib import Path


def test_random_calls_of_the_api_end_in_results_or_exceptions():
    command = [sys.executable, str(Path(__file__).parent / "random_api_calls.py"), "10000", "20261125"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    taken = int(re.fullmatch(r"10000 calls, (\d+) of them taken", done.stdout.splitlines()[-1])[1])
    # Neither are all of them refused nor all taken.
    assert 1000 < taken < 9000, taken
