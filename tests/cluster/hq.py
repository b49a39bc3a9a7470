"""HyperQueue for tests: a server and two workers of one processor each, of which one is killed while it works.

    hq.py FOLDER SCRIPT COUNT    runs SCRIPT as the tasks 1 to COUNT of an array, as `hq submit --array=1-COUNT SCRIPT` does; fails unless all end well

The package on PyPI has no command `hq`, and its server and workers are threads of the process that starts them, so each gets a process of its own here.
"""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

PATIENCE_S = 120.0


def until_the_end_of_input() -> None:
    print("ready", flush=True)
    while os.read(0, 4096):
        pass
    # Without waiting for HyperQueue's threads.
    os._exit(0)


def server(folder: str) -> None:
    from hyperqueue import LocalCluster

    cluster = LocalCluster(folder)
    until_the_end_of_input()
    del cluster


def worker(folder: str, own: str) -> None:
    """A worker of the server in ``folder``: started by way of a server of its own, whose address is replaced."""
    from hyperqueue import LocalCluster
    from hyperqueue.cluster import WorkerConfig

    cluster = LocalCluster(own)
    address = Path(own) / "hq-current"
    address.unlink()
    address.symlink_to(Path(folder) / "hq-current")
    cluster.start_worker(WorkerConfig(cores=1))
    cluster.stop()
    until_the_end_of_input()


def started(role: str, *folders: Path) -> subprocess.Popen:
    process = subprocess.Popen(
        [sys.executable, __file__, "--role", role, *map(str, folders)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "RUST_BACKTRACE": "0"},
    )
    for line in process.stdout:
        # The server prints a table before it, without a line end.
        if line.strip().endswith(b"ready"):
            return process
    raise SystemExit(f"the {role} does not start")


def array(script: str, count: int, logs: Path):
    from hyperqueue import Job

    # As the command: failed tasks do not cancel the others.
    job = Job(name="shards", max_fails=None)
    for number in range(1, count + 1):
        task = job.program([script], stdout=None, stderr=str(logs / "%{TASK_ID}.%{INSTANCE_ID}.log"))
        task.task_id = number
    job.task_map = {task.task_id: task for task in job.tasks}
    return job


def main(folder: Path, script: str, count: int) -> None:
    from hyperqueue import Client

    logs = folder / "logs"
    logs.mkdir(parents=True)
    processes = [started("server", folder / "server")]
    processes += [started("worker", folder / "server", folder / f"worker-{number}") for number in (1, 2)]
    try:
        client = Client(folder / "server")
        submitted = client.submit(array(script, count, logs))
        begin, killed, counts = time.monotonic(), False, {}

        def watch(status) -> None:
            nonlocal killed
            counts.update(status[submitted.id])
            if not killed and counts["finished"] >= count // 8:
                os.kill(processes[1].pid, signal.SIGKILL)
                killed = True
            if time.monotonic() - begin > PATIENCE_S:
                raise SystemExit(f"not done after {PATIENCE_S} s: {counts}")

        client.connection.wait_for_jobs([submitted.id], watch)
        failed = {number: context.error for number, context in client.get_failed_tasks(submitted).items()}
        print(json.dumps({"finished": counts["finished"], "failed": failed, "killed": killed}))
        if failed or counts["finished"] != count:
            raise SystemExit(1)
    finally:
        for process in reversed(processes):
            process.stdin.close()
        for process in processes:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


if __name__ == "__main__":
    if sys.argv[1] == "--role":
        {"server": server, "worker": worker}[sys.argv[2]](*sys.argv[3:])
    else:
        main(Path(sys.argv[1]).resolve(), sys.argv[2], int(sys.argv[3]))
