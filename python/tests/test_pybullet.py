"""The drop-in for PyBullet: its interface here, its numbers against PyBullet itself where that is installed."""

import copy
import importlib.util
import inspect
import json
import multiprocessing
import os
import pathlib
import pickle
import subprocess
import sys

import numpy as np
import pytest

import sfers_rs
from sfers_rs import pybullet as p
from sfers_rs.pybullet import pybullet_data
from sfers_rs.pybullet.pybullet_utils.bullet_client import BulletClient

HERE = pathlib.Path(__file__).parent
ROOT = HERE.parent.parent
PACKAGES = str(pathlib.Path(sfers_rs.__file__).parent.parent)
DROP_IN = [sys.executable, "-m", "sfers_rs.pybullet"]


def run(command, **keywords):
    """Runs a command that finds this package; its result, without error."""
    environment = os.environ | {"PYTHONPATH": PACKAGES}
    result = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, **keywords)
    assert result.returncode == 0, result.stderr
    return result


@pytest.fixture
def real():
    """The command of a Python with PyBullet."""
    if importlib.util.find_spec("pybullet") is None or p is sys.modules.get("pybullet"):
        if os.environ.get("SFERS_REQUIRE_TOOLS") == "1":
            pytest.fail("PyBullet is not installed")
        pytest.skip("PyBullet is not installed")
    return [sys.executable]


@pytest.fixture
def client():
    """A client's id, disconnected afterwards."""
    number = p.connect(p.DIRECT)
    yield number
    try:
        p.disconnect(physicsClientId=number)
    except p.error:
        pass


def make(client, links=2, **keywords):
    """A short chain."""
    box = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1, 0.1, 0.1], physicsClientId=client)
    arguments = {
        "linkMasses": [1] * links,
        "linkCollisionShapeIndices": [box] * links,
        "linkVisualShapeIndices": [-1] * links,
        "linkPositions": [[0.3, 0, 0]] * links,
        "linkOrientations": [[0, 0, 0, 1]] * links,
        "linkInertialFramePositions": [[0.1, 0, 0]] * links,
        "linkInertialFrameOrientations": [[0, 0, 0, 1]] * links,
        "linkParentIndices": list(range(links)),
        "linkJointTypes": [p.JOINT_REVOLUTE] * links,
        "linkJointAxis": [[0, 1, 0]] * links,
    }
    return p.createMultiBody(1, box, -1, [0, 0, 0], [0, 0, 0, 1], **(arguments | keywords), physicsClientId=client)


# ---- numbers ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scenario", ["chains", "two_in_a_world", "saved", "trees"])
def test_every_number_read_has_pybullets_bits(real, tmp_path, scenario):
    texts = []
    for name, command in (("real", real), ("ours", DROP_IN)):
        run([*command, str(HERE / "scenarios.py"), scenario, str(tmp_path / name)])
        texts.append((tmp_path / name).read_text().splitlines())
    theirs, ours = texts
    assert len(theirs) == len(ours) > 0
    for row, (expected, found) in enumerate(zip(theirs, ours)):
        assert found == expected, f"row {row}"


MATERIAL = {
    "width": 2.0, "actuator_length": 10.0, "gravity": 980.0, "piezo_thickness": 0.03, "adhesive_thickness": 0.002, "substrate_thickness": 0.005,
    "piezo_modulus": 3e11, "adhesive_modulus": 3e10, "substrate_modulus": 2e12, "piezo_poisson": 0.31, "substrate_poisson": 0.3,
    "d33": 4e-8, "electrode_pitch": 0.05, "piezo_density": 5.4, "adhesive_density": 1.2, "substrate_density": 7.9,
}  # fmt: skip


@pytest.mark.parametrize("mount", ["ground", "clamped", "free"])
def test_the_reference_recipe_has_equal_bits(real, tmp_path, mount):
    spec = {
        "material": MATERIAL, "actuators": 5, "motors_per_actuator": 2, "mount": mount, "damping_eta": None, "damping_time": 0.002,
        "collision_thickness": 0.1, "positive_gain": 1.3, "time_step": 2e-5, "steps": 600, "record_every_steps": 20,
        "friction": {"film": "both-ends", "film_fraction": 0.3, "low": 0.5, "high": 2.0, "ground": 0.4},
        "drive": {"waveform": "sine", "amplitudes": [300.0, -500.0, 200.0, 100.0, 400.0], "frequency": 40.0},
    }  # fmt: skip
    found = []
    for name, command in (("real", real), ("ours", DROP_IN)):
        spec["out"] = str(tmp_path / f"{name}.npz")
        run([*command, str(ROOT / "src/crosscheck/reference.py")], input=json.dumps(spec))
        found.append(np.load(spec["out"]))
    theirs, ours = found
    assert sorted(theirs) == sorted(ours)
    assert np.abs(theirs["dataTheta"]).max() > 1e-4
    for key in theirs:
        assert np.array_equal(theirs[key], ours[key]), key


# ---- interface -------------------------------------------------------------------------------------------------------


def test_answers_are_tuples_of_floats_and_ids_are_ints(client):
    body = make(client)
    assert body == 0 and type(body) is int
    assert p.stepSimulation(physicsClientId=client) == ()
    assert p.getJointStates(body, [], physicsClientId=client) is None
    states = p.getJointStates(body, range(2), physicsClientId=client)
    assert [[type(value) for value in state] for state in states] == [[float, float, tuple, float]] * 2
    links = p.getLinkStates(body, range(3), computeLinkVelocity=1, physicsClientId=client)
    assert links[2] == -1.0 and [len(value) for value in links[0]] == [3, 4, 3, 4, 3, 4, 3, 3]
    assert links[0] == p.getLinkState(body, 0, 1, physicsClientId=client)
    assert len(p.getLinkState(body, 0, physicsClientId=client)) == 6
    assert p.getLinkState(body, 2, physicsClientId=client) is None
    position, orientation = p.getBasePositionAndOrientation(body, physicsClientId=client)
    assert position == (0.0, 0.0, 0.0) and orientation == (0.0, 0.0, 0.0, 1.0)
    assert [len(value) for value in p.getBaseVelocity(body, physicsClientId=client)] == [3, 3]
    assert p.createConstraint(body, -1, -1, -1, 4, [0] * 3, [0] * 3, [0] * 3, physicsClientId=client) == 1
    flat = [value for link in links[:2] for part in link for value in part]
    assert all(type(value) is float for value in flat)
    frame = [value for link in links[:2] for part in link[4:6] for value in part]
    assert all(float(np.float32(value)) == value for value in frame)


def test_links_are_numbered_depth_first(client):
    body = make(client, 3, linkParentIndices=[0, 0, 1], linkMasses=[1, 2, 3], linkPositions=[[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    places = [state[4] for state in p.getLinkStates(body, range(3), physicsClientId=client)]
    assert places == [(1, 0, 0), (1, 0, 1), (0, 1, 0)]


def test_a_torque_lasts_one_step_and_torques_add(client):
    body = make(client)
    for joint in range(2):
        p.setJointMotorControl2(body, joint, p.VELOCITY_CONTROL, force=0, physicsClientId=client)

    def rate():
        p.stepSimulation(physicsClientId=client)
        return p.getJointState(body, 0, physicsClientId=client)[1]

    p.changeDynamics(body, -1, linearDamping=0, angularDamping=0, physicsClientId=client)
    p.setJointMotorControl2(body, 0, p.TORQUE_CONTROL, force=1e-3, physicsClientId=client)
    once = rate()
    assert once > 0 and rate() == pytest.approx(once, rel=1e-3)
    for _ in range(2):
        p.setJointMotorControlArray(body, np.arange(1), p.TORQUE_CONTROL, forces=np.full(1, 5e-4), physicsClientId=client)
    assert rate() == pytest.approx(2 * once, rel=1e-3)


def test_clients_are_apart_and_ids_are_used_again():
    clients = [p.connect(p.DIRECT) for _ in range(3)]
    assert make(clients[1]) == 0 and p.getNumJoints(0, physicsClientId=clients[2]) == 0
    p.disconnect(physicsClientId=clients[1])
    for call in (p.disconnect, p.stepSimulation):
        with pytest.raises(p.error, match="Not connected"):
            call(physicsClientId=clients[1])
    assert p.connect(p.DIRECT) == clients[1]
    for client in clients:
        p.disconnect(physicsClientId=client)


def test_at_most_1024_clients():
    before = p.connect(p.DIRECT)
    clients = [p.connect(p.DIRECT) for _ in range(1023 - before)]
    with pytest.raises(p.error, match="1024 clients"):
        p.connect(p.DIRECT)
    for client in [before, *clients]:
        p.disconnect(physicsClientId=client)


def test_reset_empties_the_world(client):
    make(client)
    p.resetSimulation(physicsClientId=client)
    assert p.getNumJoints(0, physicsClientId=client) == 0 and make(client) == 0


def test_a_state_of_another_make_up_is_refused(client, tmp_path):
    file = str(tmp_path / "state")
    make(client, 2)
    p.saveBullet(bulletFileName=file, physicsClientId=client)
    p.resetSimulation(physicsClientId=client)
    make(client, 3)
    with pytest.raises(p.error, match="fileName"):
        p.restoreState(fileName=file, physicsClientId=client)
    for content in (b"", b"123", b"x" * 800):
        pathlib.Path(file).write_bytes(content)
        with pytest.raises(p.error, match="fileName"):
            p.restoreState(fileName=file, physicsClientId=client)


def test_a_bullet_client_binds_its_id_and_disconnects_when_collected():
    one, two = BulletClient(p.DIRECT), BulletClient(connection_mode=p.DIRECT)
    make(two._client)
    assert (one.getNumJoints(0), two.getNumJoints(0), one.DIRECT) == (0, 2, p.DIRECT)
    assert all(inspect.isbuiltin(getattr(p, name)) for name in ("stepSimulation", "getLinkStates", "disconnect"))
    number = two._client
    del two
    with pytest.raises(p.error):
        p.stepSimulation(physicsClientId=number)
    one.disconnect()
    assert one._client == -1


def test_copies_and_pickles_are_the_same_client():
    one = BulletClient(p.DIRECT)
    make(one._client)
    for other in (copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
        assert other._client == one._client and other.getNumJoints(0) == 2
        other._pid = -1  # or its end would be the client's
    step = pickle.loads(pickle.dumps(one.stepSimulation))
    assert step() == ()


def fall(client):
    """The height after a fall, in a forked worker."""
    client.setGravity(0, 0, -9.8)
    for _ in range(10):
        client.stepSimulation()
    return client.getBasePositionAndOrientation(0)[0][2]


def test_forked_workers_use_their_own_copies():
    one = BulletClient(p.DIRECT)
    make(one._client)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        heights = pool.map(fall, [one] * 2, chunksize=1)
    assert heights[0] < 0 and one.getBasePositionAndOrientation(0)[0][2] == 0
    assert fall(one) == max(heights)


# ---- refusals --------------------------------------------------------------------------------------------------------

NAN = float("nan")
REFUSED = [
    ("halfExtents", lambda c, b: p.createCollisionShape(3, halfExtents=[1, 2], physicsClientId=c)),
    ("halfExtents", lambda c, b: p.createCollisionShape(3, halfExtents=[1, 2, -1], physicsClientId=c)),
    ("halfExtents", lambda c, b: p.createCollisionShape(3, halfExtents=7, physicsClientId=c)),
    ("shapeType", lambda c, b: p.createCollisionShape(2, halfExtents=[1, 2, 3], physicsClientId=c)),
    ("baseMass", lambda c, b: p.createMultiBody(-1, physicsClientId=c)),
    ("baseMass", lambda c, b: p.createMultiBody("1", physicsClientId=c)),
    ("baseCollisionShapeIndex", lambda c, b: p.createMultiBody(1, 99, physicsClientId=c)),
    ("baseOrientation", lambda c, b: p.createMultiBody(1, -1, -1, [0, 0, 0], [0, 0, 0, 0], physicsClientId=c)),
    ("basePosition", lambda c, b: p.createMultiBody(1, -1, -1, [0, 0, NAN], physicsClientId=c)),
    ("linkParentIndices", lambda c, b: make(c, linkParentIndices=[2, 1])),
    ("linkJointAxis", lambda c, b: make(c, linkJointAxis=[[0, 0, 0]] * 2)),
    ("linkJointTypes", lambda c, b: make(c, linkJointTypes=[1, 1])),
    ("linkMasses", lambda c, b: make(c, 128)),
    ("linkPositions", lambda c, b: make(c, linkPositions=[[0, 0, 0]])),
    ("bodyUniqueId", lambda c, b: p.getJointStates(9, [0], physicsClientId=c)),
    ("bodyUniqueId", lambda c, b: p.getBaseVelocity(-1, physicsClientId=c)),
    ("jointIndex", lambda c, b: p.getJointStates(b, range(3), physicsClientId=c)),
    ("linkIndex", lambda c, b: p.getLinkState(b, -1, physicsClientId=c)),
    ("linkIndex", lambda c, b: p.changeDynamics(b, -2, physicsClientId=c)),
    ("lateralFriction", lambda c, b: p.changeDynamics(b, 0, lateralFriction=-1, physicsClientId=c)),
    ("jointDamping", lambda c, b: p.changeDynamics(b, 0, jointDamping=NAN, physicsClientId=c)),
    ("forces", lambda c, b: p.setJointMotorControlArray(b, [0, 1], 1, forces=[1], physicsClientId=c)),
    ("forces", lambda c, b: p.setJointMotorControlArray(b, [0], 1, forces=[NAN], physicsClientId=c)),
    ("controlMode", lambda c, b: p.setJointMotorControl2(b, 0, 2, physicsClientId=c)),
    ("jointType", lambda c, b: p.createConstraint(b, -1, -1, -1, 5, [0] * 3, [0] * 3, [0] * 3, physicsClientId=c)),
    ("timeStep", lambda c, b: p.setTimeStep(-1, physicsClientId=c)),
    ("gravZ", lambda c, b: p.setGravity(0, 0, NAN, physicsClientId=c)),
    ("fileName", lambda c, b: p.loadURDF("robot.urdf", physicsClientId=c)),
    ("fileName", lambda c, b: p.loadURDF("plane.urdf", physicsClientId=c)),
    ("fileName", lambda c, b: p.restoreState(fileName="/nowhere/at/all", physicsClientId=c)),
    ("bulletFileName", lambda c, b: p.saveBullet("/nowhere/at/all", physicsClientId=c)),
    ("quaternion", lambda c, b: p.getEulerFromQuaternion([1, 2, 3])),
    ("physicsClientId", lambda c, b: p.stepSimulation(physicsClientId=1025)),
    ("method", lambda c, b: p.connect(1)),
]


@pytest.mark.parametrize(("argument", "call"), REFUSED)
def test_a_wrong_argument_is_named(client, argument, call):
    body = make(client)
    with pytest.raises((p.error, TypeError), match=argument):
        call(client, body)


def test_other_functions_are_refused_by_name(real):
    names = run([*real, "-c", "import pybullet as p; print(*[n for n in dir(p) if callable(getattr(p, n))])"]).stdout.split("\n")[-2].split()
    unknown = [name for name in names if name not in p.__all__ and not name.startswith("__")]
    assert len(unknown) > 100
    for name in unknown:
        with pytest.raises(p.error, match=f"pybullet.{name} .*issue tracker"):
            getattr(p, name)


# ---- running code ----------------------------------------------------------------------------------------------------


def test_scripts_modules_code_and_standard_input_run(tmp_path):
    (tmp_path / "helper.py").write_text("import sys, pybullet\nprint(pybullet.__name__, sys.argv[1:], __name__)\n")
    expected = "sfers_rs.pybullet ['a', '-b'] __main__\n"
    text = (tmp_path / "helper.py").read_text()
    for arguments, stdin in ((["helper.py"], ""), (["-m", "helper"], ""), (["-c", text], ""), (["-"], text)):
        assert run([*DROP_IN, *arguments, "a", "-b"], input=stdin, cwd=tmp_path).stdout == expected, arguments


def test_pytest_runs_on_it(tmp_path):
    (tmp_path / "test_it.py").write_text(
        "import pybullet_data\nfrom pybullet_utils import bullet_client\nimport pybullet\n\n"
        "def test_it():\n    c = bullet_client.BulletClient(connection_mode=pybullet.DIRECT)\n"
        "    c.setAdditionalSearchPath(pybullet_data.getDataPath())\n    assert c.loadURDF('plane.urdf') == 0\n"
    )
    assert "1 passed" in run([*DROP_IN, "-m", "pytest", "-q", "-p", "no:cacheprovider"], cwd=tmp_path).stdout


def test_the_version_of_pybullet_is_known():
    code = "import importlib.metadata as m; print(m.version('pybullet'))"
    assert run([*DROP_IN, "-c", code]).stdout.strip() == "3.2.7"


def test_the_limit_of_velocities_is_the_bodys_even_by_a_link_that_is_not_there(client):
    body = make(client)
    p.changeDynamics(body, 9, maxJointVelocity=0.25, physicsClientId=client)
    for joint in range(2):
        p.setJointMotorControl2(body, joint, p.VELOCITY_CONTROL, force=0, physicsClientId=client)
    p.setJointMotorControl2(body, 1, p.TORQUE_CONTROL, force=100, physicsClientId=client)
    p.stepSimulation(physicsClientId=client)
    assert p.getJointState(body, 1, physicsClientId=client)[1] == 0.25


def test_the_floor_is_pybullets(client):
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    assert p.loadURDF("plane.urdf", [0, 0, -0.05], globalScaling=10.0, physicsClientId=client) == 0


def test_random_calls_neither_crash_nor_hang(tmp_path):
    run([sys.executable, str(HERE / "random_calls.py"), "10000", "7"], cwd=tmp_path)
