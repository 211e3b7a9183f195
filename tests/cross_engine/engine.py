"""Plays a trial that `shakedown export-mjcf` wrote in MuJoCo.

The model stands in the hand's frame, so the moving hand of the schedule becomes fictitious forces
on the object (linear, Euler, centrifugal, Coriolis) and the matching torques. The fingers need none:
they slide along the closing axis, which no load of a built-in protocol accelerates much.
"""

import json
from pathlib import Path

import mujoco
import numpy as np

REST_S, REST_SPEED = 0.02, 1e-3


def rotation(q):
    """Rotation matrices of quaternions xyzw, (n, 4) -> (n, 3, 3)."""
    x, y, z, w = q.T
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1),
        ],
        -2,
    )


class Schedule:
    """Pose of the hand over time with its derivatives, all in the hand's own axes."""

    def __init__(self, rows, dt):
        rows = np.array(rows)
        rest = np.array([[0.0] * 7 + [1.0] + [0.0] * 3])
        rows = np.vstack([rest, rows, rows[-1:]])
        position, self.turn, self.force = rows[:, 1:4], rotation(rows[:, 4:8]), rows[:, 8:11]
        acceleration = np.gradient(np.gradient(position, dt, axis=0), dt, axis=0)
        spin = np.gradient(self.turn, dt, axis=0)
        skew = np.einsum("nji,njk->nik", self.turn, spin)
        self.omega = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], -1)
        self.alpha = np.gradient(self.omega, dt, axis=0)
        self.acceleration = np.einsum("nji,nj->ni", self.turn, acceleration)

    def __len__(self):
        return len(self.omega) - 2


class Trial:
    """One trial: `Trial(directory).run()` gives the outcome and what was measured."""

    def __init__(self, directory):
        directory = Path(directory)
        self.spec = json.loads((directory / "trial.json").read_text())
        self.p = self.spec["protocol"]
        self.dt = self.spec["dt_s"]
        self.model = mujoco.MjModel.from_xml_path(str(directory / "trial.xml"))
        self.data = mujoco.MjData(self.model)
        body = lambda name: self.model.body(name).id
        self.object, self.left, self.right = body("object"), body("left"), body("right")
        self.fingers = [self.model.joint(n).dofadr[0] for n in ("left", "right")]
        self.free = self.model.joint(self.model.body("object").jntadr[0]).dofadr[0]
        self.inertia = self._inertia()
        self.buffer = np.zeros(6)

    def _inertia(self):
        turn = rotation(np.roll(self.model.body_iquat[self.object], -1)[None])[0]
        return turn @ np.diag(self.model.body_inertia[self.object]) @ turn.T

    def run(self):
        force = self.spec["grip_force_n"]
        self.data.qvel[self.fingers] = self.p["closing_speed_m_s"]
        self.data.ctrl[:] = force
        mujoco.mj_forward(self.model, self.data)
        touching = self._close(force)
        if touching != (True, True):
            return {"outcome": "no_contact", "slip_m": None, "steps": self.steps}
        closed = self._pose()
        self.model.dof_damping[self.fingers] = 0.0
        outcome = self._load(Schedule(self.spec["schedule"][0], self.dt))
        slip = np.linalg.norm(self._pose()[0] - closed[0])
        cosine = (np.trace(closed[1].T @ self._pose()[1]) - 1) / 2
        turn = np.arccos(np.clip(cosine, -1, 1))
        if outcome == "held" and (slip > self.p["max_slip_m"] or turn > self.p["max_slip_rad"]):
            outcome = "slipped"
        return {"outcome": outcome, "slip_m": float(slip), "steps": self.steps}

    def _close(self, force):
        self.model.dof_damping[self.fingers] = force / self.p["closing_speed_m_s"]
        damping = self.p["object_damping_1_s"]
        rest, touching = 0.0, (False, False)
        self.steps = 0
        for _ in range(round(self.p["closing_time_s"] / self.dt)):
            velocity = self.data.qvel[self.free : self.free + 6]
            turn = self._pose()[1]
            self.data.xfrc_applied[self.object, :3] = -self.spec["mass_kg"] * damping * velocity[:3]
            self.data.xfrc_applied[self.object, 3:] = -damping * turn @ (self.inertia @ velocity[3:])
            self._step()
            touching = self._touching()
            still = np.all(np.abs(self.data.qvel[self.fingers]) < REST_SPEED)
            rest = rest + self.dt if still and touching == (True, True) else 0.0
            if self.p["closing_ends_at_rest"] and rest >= REST_S:
                break
        return touching

    def _load(self, schedule):
        gravity = np.array(self.spec["gravity_in_hand_m_s2"])
        lost = 0.0
        for k in range(1, len(schedule) + 1):
            self._inertial(schedule, k, gravity)
            self._step()
            lost = 0.0 if any(self._touching()) else lost + self.dt
            if lost > self.p["lost_contact_s"]:
                return "dropped"
        seen = np.zeros(2, bool)
        for _ in range(round(REST_S / self.dt)):
            self._inertial(schedule, len(schedule), gravity)
            self._step()
            seen |= self._touching()
        return "held" if seen.all() else "dropped"

    def _inertial(self, s, k, gravity):
        m = self.spec["mass_kg"]
        x, turn = self._pose()
        velocity = self.data.qvel[self.free : self.free + 6]
        v, spin = velocity[:3], turn @ velocity[3:]
        omega, alpha = s.omega[k], s.alpha[k]
        a = s.acceleration[k] + np.cross(alpha, x) + np.cross(omega, np.cross(omega, x))
        a += 2 * np.cross(omega, v)
        inertia = turn @ self.inertia @ turn.T
        total = omega + spin
        torque = np.cross(spin, inertia @ spin) - inertia @ alpha
        torque += inertia @ np.cross(spin, omega) - np.cross(total, inertia @ total)
        outside = s.turn[k].T @ (s.force[k] + m * gravity)
        self.data.xfrc_applied[self.object, :3] = outside - m * a
        self.data.xfrc_applied[self.object, 3:] = torque

    def _step(self):
        mujoco.mj_step(self.model, self.data)
        self.steps += 1

    def _pose(self):
        return self.data.xpos[self.object].copy(), self.data.xmat[self.object].reshape(3, 3).copy()

    def _touching(self):
        seen = {self.left: False, self.right: False}
        for i in range(self.data.ncon):
            bodies = {self.model.geom_bodyid[g] for g in self.data.contact[i].geom}
            if self.object not in bodies:
                continue
            finger = (bodies - {self.object}).pop() if len(bodies) == 2 else None
            if finger in seen and not seen[finger]:
                mujoco.mj_contactForce(self.model, self.data, i, self.buffer)
                seen[finger] = self.buffer[0] > 0
        return seen[self.left], seen[self.right]
