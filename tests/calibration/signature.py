"""The signature of FleX's labels beside the trials' own: success by width and wedge angle.

    python tests/calibration/signature.py RUN ../shared/acronym/seen docs/validation/signature.json

RUN is a run directory over the grasp files. Width and wedge (half the angle between the mean contact
normals of the two pads) come from 99 rays per pad at first touch, without simulation. Needs the Python
packages trimesh, embreex and h5py.
"""

import csv
import json
import sys
from collections import defaultdict
from pathlib import Path

import h5py
import numpy as np
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

WIDTHS = [0, 10, 20, 30, 40, 50, 60, 70, 80]
WEDGES = [0, 1, 3, 5, 8, 12, 20, 90]
OPENING, BAND = 0.08, 0.0005


def touch(rays, mesh, pose, side):
    """First touch of one pad (m from the open pad) and the mean normal there, hand axes."""
    grid = np.array([[side * OPENING / 2, y, z] for y in np.linspace(-0.0085, 0.0085, 9) for z in np.linspace(0.0946, 0.112, 11)])
    origins = grid @ pose[:3, :3].T + pose[:3, 3]
    directions = np.repeat(-side * pose[:3, :1].T, len(grid), axis=0)
    face, ray, hit = rays.intersects_id(origins, directions, multiple_hits=False, return_locations=True)
    if len(ray) == 0:
        return None
    depth = np.linalg.norm(hit - origins[ray], axis=1)
    near = depth < depth.min() + BAND
    normals = mesh.face_normals[face[near]] @ pose[:3, :3]
    normals *= np.sign(normals[:, :1] * side + 1e-12)
    mean = normals.mean(axis=0)
    return depth.min(), mean / (np.linalg.norm(mean) + 1e-12)


def main():
    run, data, out = map(Path, sys.argv[1:4])
    rows = defaultdict(list)
    for row in csv.DictReader((run / "trials.csv").open()):
        rows[row["object"]].append(row)
    cells = defaultdict(lambda: [0, 0, 0])
    for name, trials in rows.items():
        with h5py.File(data / "grasps" / f"{name}.h5") as file:
            poses = file["grasps/transforms"][()]
            mesh = trimesh.load(data / file["object/file"][()].decode(), force="mesh", process=False)
            mesh.apply_scale(float(file["object/scale"][()]))
        rays = RayMeshIntersector(mesh)
        for trial in trials:
            pose = poses[int(trial["grasp"])]
            left, right = (touch(rays, mesh, pose, side) for side in (1, -1))
            if left is None or right is None:
                continue
            width = (OPENING - left[0] - right[0]) * 1e3
            wedge = np.degrees(np.arccos(np.clip(-left[1] @ right[1], -1, 1))) / 2
            i = np.searchsorted(WIDTHS, width, side="right") - 1
            j = np.searchsorted(WEDGES, wedge, side="right") - 1
            if 0 <= i < len(WIDTHS) - 1 and 0 <= j < len(WEDGES) - 1:
                cell = cells[i, j]
                cell[0] += 1
                cell[1] += int(trial["label"])
                cell[2] += int(trial["held"])
    table = [[cells[i, j] for j in range(len(WEDGES) - 1)] for i in range(len(WIDTHS) - 1)]
    out.write_text(json.dumps({"width_mm": WIDTHS, "wedge_deg": WEDGES, "cells": table}) + "\n")
    for i, line in enumerate(table):
        text = [f"{a / n:.2f}/{b / n:.2f}" if n >= 10 else "         " for n, a, b in line]
        print(f"{WIDTHS[i]:3}-{WIDTHS[i + 1]:2} mm ", "  ".join(text))


if __name__ == "__main__":
    main()
