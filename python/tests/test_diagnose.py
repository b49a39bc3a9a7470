"""The diagnosis of data sets of robots."""

import json
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest
from sfers_rs import Diagnosis, diagnose
from sfers_rs.errors import DataError, ExperimentError

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def released():
    return diagnose(EXAMPLES / "released")


def test_a_data_set_is_diagnosed_as_by_the_command(released):
    assert isinstance(released, Diagnosis)
    assert released.verdict == released.json["verdict"] and released.summary and released.report.startswith("<!")
    assert sorted(released.files) == ["drive.csv", "extended.toml", "report.html", "residuals.csv"]


def test_it_is_saved_with_all_files_and_pickled(released, tmp_path):
    folder = released.save(tmp_path / "deep" / "found")
    names = ["diagnosis.json", "drive.csv", "extended.toml", "report.html", "residuals.csv"]
    assert sorted(path.name for path in folder.iterdir()) == names
    assert json.loads((folder / "diagnosis.json").read_text()) == released.json
    assert pickle.loads(pickle.dumps(released)) == released
    assert len(released.to_pandas()) == sum(len(effect.parameters) for effect in released.effects)


def test_results_do_not_depend_on_jobs(released):
    assert diagnose(EXAMPLES / "released" / "dataset.toml", jobs=1).json == released.json


def test_what_cannot_be_read_is_an_error_with_its_place(tmp_path):
    with pytest.raises(DataError, match="nowhere"):
        diagnose(tmp_path / "nowhere.toml")
    (tmp_path / "dataset.toml").write_text("name = 3\n")
    with pytest.raises(ExperimentError, match="name"):
        diagnose(tmp_path)
    with pytest.raises(ValueError, match="jobs must be 1 to 1024, not 0"):
        diagnose(EXAMPLES / "released", jobs=0)


def test_an_exception_of_progress_ends_it():
    def stop(task):
        raise LookupError(task)

    with pytest.raises(LookupError, match="the nominal model"):
        diagnose(EXAMPLES / "released", progress=stop)


def test_ctrl_c_ends_it_within_seconds():
    code = f"""
        from sfers_rs import diagnose
        diagnose({str(EXAMPLES / "slow_loops")!r}, progress=lambda task: print(task, flush=True))
    """
    process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(code)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.readline()
    start = time.monotonic()
    os.kill(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=30.0)
    assert time.monotonic() - start < 10.0
    assert process.returncode != 0 and errors.strip().endswith("KeyboardInterrupt"), errors
