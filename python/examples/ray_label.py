"""Labels a directory of meshes over a Ray cluster.

    pip install ray
    python python/examples/ray_label.py meshes/ --out labels --grasps-per-object 2000

Every mesh is a task of one CPU that runs `shakedown label` into the shared directory. The command
writes each file under another name and renames it when it is whole, and the bits depend on mesh and
seed alone: a task whose worker dies is done again on another one, and the files are those of one
process. Without `--address` Ray starts on this machine.
"""

import argparse
import pathlib
import shutil
import subprocess
import sys
import time

import ray

try:
    from ray import cloudpickle
    # The workers need no copy of this file.
    cloudpickle.register_pickle_by_value(sys.modules[__name__])
except (ImportError, ValueError):
    pass

MESHES = {".obj", ".stl", ".ply", ".off", ".glb", ".gltf"}


def label(binary, mesh, out, extra):
    """Labels one mesh; returns its name and the printed table."""
    command = [binary, "label", "--objects", mesh, "--out", out, "--threads", "1", "-q", *extra]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{mesh}: {done.stderr.strip()}")
    return mesh, done.stdout


def run(binary, meshes, out, extra, on_start=lambda: None):
    """Labels all meshes on the connected cluster; yields what `label` returned as tasks end."""
    # A worker that dies costs its task a retry, never the job.
    task = ray.remote(num_cpus=1, max_retries=10)(label)
    waiting = [task.remote(binary, str(m), str(out), list(extra)) for m in meshes]
    on_start()
    while waiting:
        ready, waiting = ray.wait(waiting)
        yield ray.get(ready[0])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("meshes", type=pathlib.Path, help="a directory of mesh files")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="on a disk all workers see")
    parser.add_argument("--address", help="of a running cluster, such as auto")
    parser.add_argument("--binary", default=shutil.which("shakedown"), help="path of shakedown")
    known, extra = parser.parse_known_args()
    if known.binary is None:
        sys.exit("shakedown is not on the PATH; say where it is with --binary")
    meshes = sorted(m.resolve() for m in known.meshes.iterdir() if m.suffix.lower() in MESHES)
    if not meshes:
        sys.exit(f"{known.meshes}: there is no mesh in it ({', '.join(sorted(MESHES))})")
    ray.init(address=known.address, log_to_driver=False)
    started = time.monotonic()
    for n, (mesh, table) in enumerate(run(known.binary, meshes, known.out.resolve(), extra), 1):
        print(f"{n}/{len(meshes)} {time.monotonic() - started:.0f} s {mesh}\n{table}", flush=True)


if __name__ == "__main__":
    main()
