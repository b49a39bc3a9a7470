"""The first steps of a user on a machine that has nothing but the wheel: Bullet comes from the wheel, on both engines something moves, licences are there."""

import importlib.metadata
import time
from pathlib import Path

begin = time.perf_counter()
import sfers_rs as sf  # noqa: E402

seconds = time.perf_counter() - begin

bullet = {line.split()[-1] for line in Path("/proc/self/maps").read_text().splitlines() if "libBullet" in line}
assert bullet and all("sfers_rs.libs" in path for path in bullet), bullet

robot = sf.Robot.cantilever(damping_eta=0.1)
for engine, step in (("planar", 1e-4), ("bullet", 1e-5)):
    recording = sf.run(robot, sf.Drive.dc([-1000]), engine=engine, time_step_s=step, duration_s=0.2, record_every_s=0.01)
    assert -30 < recording.measures["tip_deflection_mm"] < -10, recording
    print(recording)

files = [str(file) for file in importlib.metadata.files("sfers-rs") or []]
assert any("BULLET.txt" in file for file in files) and any("RUST-CRATES.txt" in file for file in files), files
print(f"sfers_rs {sf.__version__} imported in {seconds:.2f} s, Bullet from {sorted(bullet)[0]}")
