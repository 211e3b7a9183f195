"""Which of these grasps hold a box? Run it after `pip install` of the wheel."""

import pathlib
import tempfile

import numpy as np

import shakedown

OBJ = """v -.015 -.025 -.04
v -.015 -.025 .04
v -.015 .025 -.04
v -.015 .025 .04
v .015 -.025 -.04
v .015 -.025 .04
v .015 .025 -.04
v .015 .025 .04
f 1 2 4
f 1 4 3
f 5 7 8
f 5 8 6
f 1 5 6
f 1 6 2
f 3 4 8
f 3 8 7
f 1 3 7
f 1 7 5
f 2 6 8
f 2 8 4
"""

mesh = pathlib.Path(tempfile.mkdtemp()) / "box.obj"
mesh.write_text(OBJ)

# From above: x closes across the box, z points down. Higher and higher, until it only pinches.
poses = np.tile(np.eye(4), (6, 1, 1))
poses[:, :3, :3] = np.diag([1.0, -1.0, -1.0])
poses[:, 2, 3] = np.linspace(0.035, 0.045, 6)
result = shakedown.simulate(mesh, poses, frame="tcp", mass_kg=0.2)
for z, outcome, p in zip(poses[:, 2, 3], result["outcome"], result["p_hold"]):
    print(f"tcp at {1e3 * z:.0f} mm, the box ends at 40 mm: {outcome}, p_hold {p:.2f}")

summary = shakedown.evaluate({"box": (mesh, poses)}, frame="tcp", facts={"box": {"mass_kg": 0.2}})
print("held:", summary["physics"]["held"], "95 %", summary["physics"]["ci95"])
