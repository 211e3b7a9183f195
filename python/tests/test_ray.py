"""The Ray example on a real local cluster, one worker of which is killed."""

import os
import pathlib
import signal
import subprocess
import sys
import threading
import time

import pytest

ray = pytest.importorskip("ray", reason="pip install ray to run the example of many machines")
sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "examples"))
import ray_label  # noqa: E402
from test_module import box  # noqa: E402

EXTRA = ["--grasps-per-object", "40", "--density-kg-m3", "400"]


def children(pid):
    return [int(p) for p in subprocess.run(["pgrep", "-P", str(pid)], capture_output=True,
                                           text=True).stdout.split()]


def kill_a_worker(killed):
    """Kills one process that labels, and the worker above it, as soon as there is one."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        found = subprocess.run(["pgrep", "-f", "label --objects"], capture_output=True,
                               text=True).stdout.split()
        own = [int(p) for p in found if int(p) in descendants(os.getpid())]
        if own:
            parent = int(pathlib.Path(f"/proc/{own[0]}/stat").read_text().rsplit(")")[1].split()[1])
            for pid in (parent, own[0]):
                os.kill(pid, signal.SIGKILL)
            killed.append(own[0])
            return
        time.sleep(0.01)


def descendants(pid):
    found, todo = set(), [pid]
    while todo:
        new = children(todo.pop())
        found.update(new)
        todo.extend(new)
    return found


def test_a_killed_worker_loses_nothing_and_the_bytes_are_those_of_one_process(tmp_path):
    binary = os.environ.get("SHAKEDOWN", "shakedown")
    meshes = [box(tmp_path / f"box{i}.obj", (0.03, 0.04 + 0.01 * i, 0.08)) for i in range(5)]
    one = tmp_path / "one"
    subprocess.run([binary, "label", "--objects", *map(str, meshes), "--out", str(one), "-q",
                    *EXTRA], check=True, capture_output=True)
    many = tmp_path / "many"
    killed = []
    ray.init(num_cpus=2, log_to_driver=False, include_dashboard=False)
    try:
        killer = threading.Thread(target=kill_a_worker, args=(killed,))
        ended = list(ray_label.run(binary, meshes, many, EXTRA, on_start=killer.start))
        killer.join()
    finally:
        ray.shutdown()
    assert killed, "a worker was killed"
    assert sorted(mesh for mesh, _ in ended) == sorted(map(str, meshes))
    files = sorted(p.relative_to(one) for p in one.rglob("*") if p.is_file())
    assert files == sorted(p.relative_to(many) for p in many.rglob("*") if p.is_file())
    for file in files:
        assert (one / file).read_bytes() == (many / file).read_bytes(), file
