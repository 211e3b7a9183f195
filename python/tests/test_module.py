"""The module against the command line: the same bits. `SHAKEDOWN` names the binary."""

import csv
import json
import math
import os
import subprocess
import threading
import time

import numpy as np
import pytest

import shakedown

POSE = ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"]
NUMBERS = ["slip_linear_m", "slip_angular_rad", "closing_linear_m", "closing_angular_rad",
           "grip_force_n", "sim_s", "penetration_m", "closing_width_m", "p_hold"]


def box(path, size=(0.03, 0.05, 0.08)):
    x, y, z = (s / 2 for s in size)
    corners = [(a, b, c) for a in (-x, x) for b in (-y, y) for c in (-z, z)]
    faces = [(1, 2, 4), (1, 4, 3), (5, 7, 8), (5, 8, 6), (1, 5, 6), (1, 6, 2),
             (3, 4, 8), (3, 8, 7), (1, 3, 7), (1, 7, 5), (2, 6, 8), (2, 8, 4)]
    lines = [f"v {a} {b} {c}" for a, b, c in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join(lines) + "\n")
    return path


def command(*args):
    binary = os.environ.get("SHAKEDOWN", "shakedown")
    return subprocess.run([binary, *map(str, args)], check=True, capture_output=True, text=True)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    home = tmp_path_factory.mktemp("run")
    mesh = box(home / "box.obj")
    command("run", "--objects", mesh, "--sampler", "antipodal", "--candidates", 24, "--out",
            home / "run", "-q")
    rows = list(csv.DictReader(open(home / "run" / "trials.csv")))
    poses = np.array([[float(r[c]) for c in POSE] for r in rows])
    return mesh, home / "run", rows, poses


def test_a_trial_is_that_of_the_command_line_bit_by_bit(run):
    mesh, _, rows, poses = run
    for threads in (1, 2):
        result = shakedown.simulate(mesh, poses, threads=threads)
        assert result["outcome"] == [r["outcome"] for r in rows]
        assert result["class"] == [r["class"] for r in rows]
        assert [int(h) for h in result["held"]] == [int(r["held"]) for r in rows]
        for name in NUMBERS:
            for ours, theirs in zip(result[name], rows):
                text = theirs[name]
                assert (math.isnan(ours) and text == "") or ours == float(text), name


def test_classify_agrees_and_asks_no_mass(run):
    mesh, _, rows, poses = run
    result = shakedown.classify(mesh, poses)
    assert result["class"] == [r["class"] for r in rows]
    assert [int(x) for x in result["centred"]] == [int(r["centred"]) for r in rows]


def test_evaluate_gives_the_numbers_of_the_summary(run):
    mesh, directory, _, poses = run
    summary = json.loads((directory / "summary.json").read_text())
    ours = shakedown.evaluate({"box": (mesh, poses)})
    for block in ("n", "geometry", "physics", "success_at"):
        assert ours[block] == summary[block]


def test_rank_puts_the_likely_first(run):
    mesh, _, rows, poses = run
    result = shakedown.rank(mesh, poses)
    assert sorted(result["order"]) == list(range(len(poses)))
    assert list(result["p_hold"]) == sorted(result["p_hold"], reverse=True)
    best = result["order"][0]
    assert result["p_hold"][0] == max(float(r["p_hold"]) for r in rows) == float(rows[best]["p_hold"])


def test_matrices_and_the_tcp_frame_mean_the_same_poses(run):
    mesh, _, _, poses = run
    x, y, z, w = poses[:, 3:].T
    matrices = np.tile(np.eye(4), (len(poses), 1, 1))
    matrices[:, :3, :3] = np.moveaxis(np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]), 2, 0)
    matrices[:, :3, 3] = poses[:, :3]
    by_numbers = shakedown.classify(mesh, poses)
    assert shakedown.classify(mesh, matrices)["class"] == by_numbers["class"]
    tcp = matrices.copy()
    tcp[:, :3, 3] += shakedown.Gripper().tcp_z_m * matrices[:, :3, 2]
    assert shakedown.classify(mesh, tcp, frame="tcp")["class"] == by_numbers["class"]


def test_the_lock_is_released_during_trials(run):
    mesh, _, _, poses = run
    ticks, done = [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    other = threading.Thread(target=tick)
    other.start()
    try:
        shakedown.simulate(mesh, np.repeat(poses, 4, axis=0), threads=1)
    finally:
        done.set()
        other.join()
    assert len(ticks) > 10, "another thread ran meanwhile"


def test_protocols_and_hands(run):
    mesh, _, _, poses = run
    assert "acronym" in shakedown.Protocol.names() and "robotiq_2f_85" in shakedown.Gripper.names()
    weak = shakedown.Protocol("acronym", grip_force_per_kg_n=1.0, shake_linear_m=0.1,
                              solver__iterations=4)
    assert weak.constants()["grip_force_per_kg_n"] == 1.0
    assert weak.constants()["solver"]["iterations"] == 4
    strong = shakedown.simulate(mesh, poses)["held"].sum()
    assert shakedown.simulate(mesh, poses, weak)["held"].sum() < strong


@pytest.mark.parametrize("call, words", [
    (lambda m: shakedown.simulate("nothing.obj", np.zeros((1, 7))), "nothing.obj"),
    (lambda m: shakedown.simulate(m, np.zeros((1, 7))), "pose 0"),
    (lambda m: shakedown.simulate(m, np.full((1, 7), np.nan)), "not finite"),
    (lambda m: shakedown.simulate(m, np.eye(4)), "shape"),
    (lambda m: shakedown.simulate(m, np.eye(4)[None], "acronim"), "acronym"),
    (lambda m: shakedown.Protocol("acronym", dt=1), "dt_s"),
    (lambda m: shakedown.evaluate({"b": (m, np.eye(4)[None])}, facts={"b": {"mass": 1}}), "mass_kg"),
])
def test_bad_input_is_an_exception_that_names_it(run, call, words):
    with pytest.raises(shakedown.ShakedownError, match=words):
        call(run[0])


def test_no_pose_is_no_error(run):
    assert len(shakedown.simulate(run[0], np.zeros((0, 7)))["held"]) == 0
