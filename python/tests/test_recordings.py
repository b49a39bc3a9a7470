"""The recordings of the published simulator, and robots at random against PyBullet, bit for bit."""

import json
import random
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from conftest import RECORDINGS, ROOT

import sfers_rs as sf

NAMES = sorted(path.stem for path in RECORDINGS.glob("*.npz"))
ARRAYS = ["dataTime", "dataTheta", "dataAngularVelocities", "dataTor", "dataMotorVoltages"]
PLACES = ["dataPositions", "dataPositionVelocities"]
REFERENCE = ROOT / "src" / "crosscheck" / "reference.py"


def by_calls(specification: dict, out: Path, *python: str) -> dict:
    """The recording of the script that makes the published simulator's calls, by a Python that has PyBullet, or by the drop-in."""
    text = json.dumps(specification | {"out": str(out)})
    subprocess.run([*python, REFERENCE], input=text, text=True, check=True, capture_output=True)
    return np.load(out)


def test_there_are_fourteen():
    assert len(NAMES) == 14


@pytest.mark.parametrize("name", NAMES)
def test_a_recording_comes_out_bit_for_bit_from_its_file_and_from_its_tables(name):
    saved = np.load(RECORDINGS / f"{name}.npz")
    file = RECORDINGS / f"{name}.toml"
    recording = sf.run(file)
    for key in ARRAYS:
        assert np.array_equal(recording[key], saved[key]), key
    # PyBullet rounds positions to single precision.
    assert np.abs(recording["dataPositions"] - saved["dataPositions"]).max() < 1e-5
    tables = tomllib.loads(file.read_text())
    assert sf.resolved(tables) == sf.resolved(file)


@pytest.mark.parametrize("name", NAMES)
def test_a_recording_comes_out_bit_for_bit_from_the_published_calls_on_the_drop_in(name, tmp_path):
    saved = np.load(RECORDINGS / f"{name}.npz")
    recording = by_calls(sf.resolved(RECORDINGS / f"{name}.toml"), tmp_path / "r.npz", sys.executable, "-m", "sfers_rs.pybullet")
    for key in ARRAYS + PLACES:
        assert np.array_equal(recording[key], saved[key]), key


def robot_at_random(generator: random.Random) -> dict:
    """An experiment of few steps with a robot, a drive and a time step at random."""
    draw, choice = generator.uniform, generator.choice
    mount, actuators = choice([("ground", 5), ("ground", 5), ("clamped", generator.randint(1, 4)), ("free", 5)])
    if mount == "clamped":
        drive = {"waveform": "sine", "amplitude_v": draw(-1400, 500), "frequency_hz": draw(1, 60)}
    else:
        gait = choice(["crawl", "inchworm", "full-inchworm", "full-frictional-inchworm", "frog-v2", "inchworm-reversed"])
        drive = {"waveform": "gait", "gait": gait, "frequency_hz": draw(40, 400)}
    return {
        "material": {
            "piezo_thickness_um": draw(200, 400), "substrate_thickness_um": draw(20, 60), "width_mm": draw(10, 40),
        },
        "robot": {
            "actuators": actuators, "motors_per_actuator": generator.randint(1, 4), "mount": mount, "damping_eta": draw(0.01, 0.1),
            "friction": {"ground": draw(0.5, 1.5), "low": draw(0.1, 1), "high": draw(1, 5), "film": choice(["both-ends", "right-end", "none"])},
        },
        "drive": drive,
        "simulation": {"engine": "bullet", "time_step_s": choice([1e-6, 2e-6, 5e-6]), "steps": 1500, "record_every_steps": 100},
    }


@pytest.mark.parametrize("seed", range(20))
def test_a_robot_at_random_has_the_bits_of_pybullet_by_the_api_and_on_the_drop_in(seed, pybullet_python, tmp_path):
    tables = robot_at_random(random.Random(seed))
    specification = sf.resolved(tables)
    reference = by_calls(specification, tmp_path / "reference.npz", pybullet_python)
    on_drop_in = by_calls(specification, tmp_path / "r.npz", sys.executable, "-m", "sfers_rs.pybullet")
    recording = sf.run(tables)
    for key in ARRAYS:
        assert np.array_equal(recording[key], reference[key]), key
    for key in ARRAYS + PLACES:
        assert np.array_equal(on_drop_in[key], reference[key]), key


def test_recordings_are_saved_and_loaded_with_equal_arrays(tmp_path: Path):
    recording = sf.Recording.load(RECORDINGS / "inchworm-m1.npz")
    recording.save(tmp_path / "again.npz")
    again = sf.Recording.load(tmp_path / "again.npz")
    assert all(np.array_equal(recording[key], again[key]) for key in recording)
