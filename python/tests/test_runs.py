"""Runs, sweeps, exports: what a user types, and what is refused."""

import copy
import os
import pickle
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import sfers_rs as sf

CANTILEVER = sf.Robot.cantilever(damping_eta=0.2)
SHORT = {"engine": "planar", "time_step_s": 1e-4, "duration_s": 0.2}


def bent(**keys) -> sf.Recording:
    return sf.run(CANTILEVER, sf.Drive.dc(-1000), **SHORT | keys)


def test_a_bent_cantilever_has_the_curvature_of_its_joints():
    recording = bent(duration_s=1.0)
    angles, nodes = recording["dataTheta"][-1], recording.nodes_mm[-1]
    # From the joints' angles: each body turns by one more, half a length at both ends.
    lengths = 100 / 3 * np.array([0.5, 1, 1, 0.5])
    directions = -np.concatenate([[0], np.cumsum(angles)])
    tip = (lengths * np.sin(directions)).sum()
    assert nodes[-1, 1] - nodes[0, 1] == pytest.approx(tip, abs=0.05)
    assert recording.measures["tip_deflection_mm"] == pytest.approx(nodes[-1, 1], abs=1e-6)


def test_all_ways_to_say_an_experiment_say_the_same():
    tables = {
        "robot": {"actuators": 1, "mount": "clamped", "damping_eta": 0.2},
        "drive": {"waveform": "dc", "voltages_v": np.array([-1000])},
        "simulation": dict(SHORT),
    }
    first = bent()
    others = [
        sf.run(tables),
        sf.run(CANTILEVER, [-1000], **SHORT),
        sf.run(CANTILEVER, {"waveform": "dc", "voltages_v": [-1000]}, **SHORT),
        sf.run("cantilever-dc", set={"robot.damping_eta": 0.2}, **SHORT),
        sf.run("preset:cantilever-dc", set={"robot.damping_eta": "0.2"}, **SHORT),
        sf.run(sf.Robot.cantilever().replaced(damping_eta=0.2), -1000, **SHORT),
    ]
    for other in others:
        assert np.array_equal(first["dataTheta"], other["dataTheta"])


def test_a_drive_from_arrays_is_the_drive_from_a_file(tmp_path):
    times = np.linspace(0, 0.2, 50)
    voltages = -500 * np.sin(40 * times) ** 2
    rows = "\n".join(f"{t!r},{v!r}" for t, v in zip(times.tolist(), voltages.tolist()))
    (tmp_path / "drive.csv").write_text(f"t_s,v1_v\n{rows}\n")
    from_file = sf.run(CANTILEVER, {"waveform": "csv", "file": str(tmp_path / "drive.csv")}, **SHORT)
    for given in (voltages, voltages[:, None]):
        assert np.array_equal(sf.run(CANTILEVER, sf.Drive.sampled(times, given), **SHORT)["dataTheta"], from_file["dataTheta"])


def test_a_recording_is_a_mapping_a_table_a_data_set_and_a_picture(tmp_path):
    recording = bent()
    assert recording["dataPositions"].shape == (len(recording.time_s), 5, 3)
    with pytest.raises(ValueError):
        recording["dataTheta"][0, 0] = 1
    table = recording.to_pandas()
    assert table.index.name == "t_s" and np.array_equal(table["theta2_rad"], recording["dataTheta"][:, 1])
    data = recording.to_xarray()
    assert data["angle"].attrs["units"] == "rad" and np.array_equal(data["position"].sel(axis="z"), recording["dataPositions"][:, :, 2])
    again = pickle.loads(pickle.dumps(recording))
    assert all(np.array_equal(again[key], recording[key]) for key in recording) and again.measures == recording.measures
    for kind in ("traces", "shapes", "spectrum"):
        figure = recording.plot(kind)
        for ending in ("svg", "png", "pdf"):
            figure.save(tmp_path / f"{kind}.{ending}")
            assert (tmp_path / f"{kind}.{ending}").stat().st_size > 2000
    assert "<iframe" in recording._repr_html_() and "tip_deflection_mm" in repr(recording)
    recording.save(tmp_path / "r.csv")
    assert (tmp_path / "r.csv").read_text().startswith("t_s,theta1_rad")


def test_trouble_takes_the_measures_away_and_says_why():
    # Far above the longest stable step of the explicit torque law.
    recording = sf.run("cantilever-dc", time_step_s=2e-4, duration_s=0.004)
    assert recording.trouble and set(recording.measures) <= {"energy_error"} and "trouble" in repr(recording)


def test_a_sweep_is_a_table_in_grid_order_and_goes_on_in_its_folder(tmp_path):
    tables = {
        "experiment": {"robot": dict(CANTILEVER.tables["robot"]), "drive": {"waveform": "dc", "voltages_v": [-1000]}, "simulation": dict(SHORT)},
        "measures": ["tip_deflection_mm"],
        "vary": {"robot.damping_eta": np.array([0.1, 0.2]), "robot.motors_per_actuator": [1, 3]},
    }
    calls = []
    table = sf.sweep(tables, out=tmp_path / "sweep", jobs=2, progress=lambda done, points: calls.append((done, points)))
    assert list(table.columns) == ["robot.damping_eta", "robot.motors_per_actuator", "tip_deflection_mm", "status"]
    assert table["robot.motors_per_actuator"].tolist() == [1, 3, 1, 3] and (table["status"] == "ok").all()
    assert table["tip_deflection_mm"][3] == bent().measures["tip_deflection_mm"]
    assert calls[-1] == (4, 4)
    again = sf.sweep(tables, out=tmp_path / "sweep", jobs=1, progress=False)
    assert again.equals(table)
    assert sf.sweep(tables, jobs=1, progress=False).equals(table)


def test_exports_hold_all_joints(tmp_path):
    robot = sf.Robot.crawler(motors_per_actuator=2)
    assert sf.urdf(robot, tmp_path / "robot.urdf").count("<joint ") == 10
    assert (tmp_path / "robot.urdf.json").exists()
    assert sf.mjcf(robot, tmp_path / "robot.xml").count('type="hinge"') + sf.mjcf(robot).count("<joint ") >= 10
    assert sf.urdf("crawl").count("<joint ") == 15


def test_presets_keys_and_effects_are_listed():
    assert "crawl" in sf.presets() and "waveform" in sf.preset("crawl")
    with pytest.raises(KeyError, match="crawll"):
        sf.preset("crawll")
    assert any(key["key"] == "robot.damping_eta" for key in sf.keys()) and "hysteresis" in sf.effects()


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: sf.run("no-such-preset"), sf.ExperimentError, ["no-such-preset"]),
        (lambda: sf.run({"robot": {"legs": 4}}), sf.ExperimentError, ["legs"]),
        (lambda: sf.run(CANTILEVER), TypeError, ["drive"]),
        (lambda: sf.run(CANTILEVER, [-1000, 2], **SHORT), sf.ExperimentError, ["voltages_v"]),
        (lambda: sf.run(CANTILEVER, [np.nan], **SHORT), ValueError, ["finite"]),
        (lambda: sf.run(CANTILEVER, [-1000], time_step_s=1e-5, duration_s=-1), sf.ExperimentError, ["duration_s"]),
        (lambda: sf.run(CANTILEVER, [object()]), (TypeError, ValueError), []),
        (lambda: sf.run("crawl", set={"robot.damping_eta": object()}), TypeError, ["object"]),
        (lambda: sf.Robot.cantilever(dampingeta=1), TypeError, ["did you mean damping_eta"]),
        (lambda: sf.Drive.sampled([0, 1], [1, 2, 3]), ValueError, ["(2,)", "(3,)"]),
        (lambda: sf.run(CANTILEVER, sf.Drive.sampled([1, 0], [1, 2]), **SHORT), ValueError, ["drive"]),
        (lambda: sf.run(CANTILEVER, sf.Drive.sampled([0, 1], [1, 1e9]), **SHORT), ValueError, ["drive"]),
        (lambda: sf.sweep({"experiment": "crawl", "measures": ["nonsense"], "vary": {"robot.damping_eta": [1]}}), sf.ExperimentError, ["nonsense"]),
        (lambda: sf.sweep("crawl-nothing"), sf.ExperimentError, ["crawl-nothing"]),
        (lambda: sf.sweep("jump-on-time-scan", jobs=0), ValueError, ["jobs"]),
        (lambda: sf.Recording.load(__file__), sf.DataError, ["test_runs.py"]),
        (lambda: bent().plot("pie"), ValueError, ["pie"]),
        (lambda: bent().save("r.txt"), ValueError, ["r.txt"]),
    ],
)
def test_whatever_is_wrong_is_named(call, error, words):
    with pytest.raises(error) as caught:
        call()
    assert all(word in str(caught.value) for word in words), caught.value


def test_errors_have_file_line_and_key_and_can_be_pickled(tmp_path):
    path = tmp_path / "e.toml"
    path.write_text('[robot]\nactuators = 1\ndamping_eta = -1\n[drive]\nwaveform = "dc"\nvoltages_v = [0]\n[simulation]\nsteps = 1\n')
    with pytest.raises(sf.ExperimentError) as caught:
        sf.run(path)
    error = pickle.loads(pickle.dumps(caught.value))
    assert (error.file, error.line, error.key) == (str(path), "3", "robot.damping_eta")


def test_robots_and_drives_are_copied_and_pickled():
    robot = copy.deepcopy(CANTILEVER)
    assert robot == pickle.loads(pickle.dumps(CANTILEVER)) == CANTILEVER


LONG = """
import sfers_rs as sf
print("begun", flush=True)
try:
    {call}
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@pytest.mark.parametrize(
    "call",
    [
        'sf.run("jump-14hz", duration_s=1000, record_every_s=1)',
        'sf.Simulation("crawl").step(10**9)',
        'sf.sweep({"experiment": "crawl", "measures": ["speed_mm_s"], "vary": {"simulation.duration_s": [1000.0, 1001.0], "simulation.record_every_s": [1.0]}})',
    ],
)
def test_control_c_is_heard(call):
    process = subprocess.Popen([sys.executable, "-c", LONG.format(call=call)], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "begun\n"
    time.sleep(1.0)
    os.kill(process.pid, signal.SIGINT)
    out, _ = process.communicate(timeout=20)
    assert out == "interrupted\n" and process.returncode == 0
