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
from sfers_rs import Diagnosis, Identification, diagnose
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


def test_a_built_in_data_set_of_single_numbers_has_no_extended_model_and_no_residuals(tmp_path):
    found = diagnose("preset:published-cantilever", out=tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["diagnosis.json", "report.html"]
    assert found.verdict and found.residuals().empty


def test_residuals_are_a_table(released):
    rows = released.residuals()
    assert {"run", "channel", "t_s", "measured_mm", "extended_mm"} <= set(rows.columns)
    used = rows[rows.used == 1]
    rms = ((used.measured_mm - used.nominal_mm) ** 2).mean() ** 0.5
    assert rms == pytest.approx(released.json["baseline"]["rmse_mm"], rel=1e-6)


BEAM = """
[robot]
actuators = 1
motors_per_actuator = 6
mount = "clamped"
damping_eta = 0.002
[identify]
seed = 3
[identify.vary]
"effect.stiffness.scale" = { from = 0.6, to = 1.8 }
[[observation]]
measure = "tip_deflection_mm"
value = -1.0
sigma = 0.01
drive = { waveform = "dc", voltages_v = [0] }
simulation = { start = "settled", time_step_s = 2e-4, duration_s = 0.01 }
"""


def test_a_data_set_with_identify_gives_constants(tmp_path):
    (tmp_path / "dataset.toml").write_text(BEAM)
    found = diagnose(tmp_path, out=tmp_path / "found")
    assert isinstance(found, Identification) and found.meets_all, found.summary
    constant = found.constants["effect.stiffness.scale"]
    # The sag is inversely proportional to the stiffness: 1.15 mm for the nominal one.
    low, high = constant["range95"]
    assert low < constant["value"] < high and constant["value"] == pytest.approx(1.15, abs=0.02)
    assert found.facts[0]["measure"] == "tip_deflection_mm" and found.confirmed.keys() == found.constants.keys()
    assert sorted(path.name for path in (tmp_path / "found").iterdir()) == ["identification.json", "identified.toml", "report.html"]
    assert "stiffness" in found.experiment and len(found.to_pandas()) == 1
    assert pickle.loads(pickle.dumps(found)) == found and "Identification of" in repr(found)


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


@pytest.mark.parametrize("dataset", [str(EXAMPLES / "slow_loops"), "preset:published-robot"])
def test_ctrl_c_ends_it_within_seconds(dataset):
    code = f"""
        from sfers_rs import diagnose
        diagnose({dataset!r}, progress=lambda task: print(task, flush=True))
    """
    process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(code)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline()
    time.sleep(1.0)
    start = time.monotonic()
    os.kill(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=30.0)
    assert time.monotonic() - start < 10.0
    assert process.returncode != 0 and errors.strip().endswith("KeyboardInterrupt"), errors
