"""MuJoCo's values for the laws of docs/validation.md: `python tests/cross_engine/laws.py OUT.json`.

The same cases as tests/src/laws.rs: a cube, cylinder or ball between two pads of 17.5 x 17.8 mm that
press with a constant force. MuJoCo with the settings that grip best: elliptic cone, impratio 10,
noslip 10, solref 0.004, 2 ms.
"""

import json
import sys

import mujoco
import numpy as np

XML = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0" cone="elliptic" impratio="10" integrator="implicitfast" noslip_iterations="10"/>
  <default><geom condim="{condim}" friction="{mu} {torsion} 0.0001" solref="0.004 1"/></default>
  <worldbody>
    <body name="left" pos="{x} 0 0"><joint name="left" type="slide" axis="-1 0 0"/>
      <geom type="box" size="0.00725 0.00875 0.0089" mass="0.1" contype="1" conaffinity="2"/></body>
    <body name="right" pos="-{x} 0 0"><joint name="right" type="slide" axis="1 0 0"/>
      <geom type="box" size="0.00725 0.00875 0.0089" mass="0.1" contype="1" conaffinity="2"/></body>
    <body name="object"><freejoint/>
      <geom {geom} mass="{mass}" contype="2" conaffinity="1"/></body>
  </worldbody>
  <equality><joint joint1="left" joint2="right" solref="0.005 1"/></equality>
  <actuator><motor joint="left"/><motor joint="right"/></actuator>
</mujoco>
"""
CUBE = 'type="box" size="0.025 0.025 0.025"'
CYLINDER = 'type="cylinder" size="0.025 0.03" euler="90 0 0"'
BALL = 'type="sphere" size="0.02"'


class Grip:
    def __init__(self, geom, mass, mu, force, half=0.025, torsion=0.0):
        condim = 4 if torsion else 3
        text = XML.format(geom=geom, mass=mass, mu=mu, x=half + 0.00725 + 0.0005, condim=condim, torsion=torsion)
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        self.force, self.limit = force, 2 * mu * force
        self.data.ctrl[:] = force
        # Close slowly: damping as a speed limit of 0.1 m/s, taken off after 0.6 s.
        self.model.dof_damping[:2] = force / 0.1
        for _ in range(300):
            mujoco.mj_step(self.model, self.data)
        self.model.dof_damping[:2] = 0
        self.start = self.pose()

    def pose(self):
        return self.data.body("object").xpos.copy(), self.data.body("object").xmat.reshape(3, 3).copy()

    def moved(self):
        x, r = self.pose()
        cosine = np.clip((np.trace(self.start[1].T @ r) - 1) / 2, -1, 1)
        return np.linalg.norm(x - self.start[0]), np.arccos(cosine)

    def load(self, wrench, seconds):
        body = self.model.body("object").id
        steps = round(seconds / 0.002)
        for k in range(1, steps + 1):
            self.data.xfrc_applied[body] = np.asarray(wrench) * min(1.0, k * 0.002 / 0.2)
            mujoco.mj_step(self.model, self.data)
            if k == steps // 2:
                self.half = self.moved()
        return self.moved()

    def delivered(self):
        wrench, total = np.zeros(6), 0.0
        for i in range(self.data.ncon):
            mujoco.mj_contactForce(self.model, self.data, i, wrench)
            total += wrench[0]
        return total / 2


def largest_held(low, high, moves):
    while high - low > 0.001 * high:
        middle = (low + high) / 2
        low, high = (low, middle) if moves(middle) else (middle, high)
    return (low + high) / 2


def slip(geom, mass, mu, force):
    def moves(share):
        grip = Grip(geom, mass, mu, force)
        return not grip.load([0, share * grip.limit, 0, 0, 0, 0], 1.2)[0] < 1e-3

    return largest_held(0.9, 1.1, moves)


def creep(mass, mu, force, share):
    grip = Grip(CUBE, mass, mu, force)
    end = grip.load([0, share * grip.limit, 0, 0, 0, 0], 4.0)[0]
    return (end - grip.half[0]) / 2 * 1e3


def twist(geom, mass, mu, force, **more):
    def moves(lever):
        grip = Grip(geom, mass, mu, force, **more)
        return not grip.load([0, 0, 0, lever * 1e-3 * grip.limit, 0, 0], 1.2)[1] < 0.1

    return largest_held(0.0, 25.0, moves)


def main():
    values = {}
    for force in (5.0, 10.0, 20.0, 40.0, 70.0):
        values[f"force_{force:g}"] = Grip(CUBE, 0.1, 0.5, force).delivered()
    for mass, mu, force in [(0.013, 0.2, 5), (0.013, 1, 10), (0.1, 0.5, 20), (0.2, 0.5, 10), (0.2, 0.5, 40), (0.5, 1, 70)]:
        values[f"slip_{mass:g}_{mu:g}_{force:g}"] = slip(CUBE, mass, mu, force)
    for force in (10, 40):
        for share in (0.5, 0.9):
            values[f"creep_{force:g}_{share:g}"] = creep(0.2, 0.5, force, share)
    values["twist_flat"] = twist(CUBE, 0.1, 0.5, 20)
    values["twist_line"] = twist(CYLINDER, 0.1, 0.5, 20)
    values["twist_ball"] = twist(BALL, 0.05, 0.5, 20, half=0.02)
    for lever in (2, 4):
        values[f"ball_{lever}"] = twist(BALL, 0.05, 0.5, 20, half=0.02, torsion=lever * 1e-3 * 0.5)
    out = {"mujoco": mujoco.__version__, "values": values}
    open(sys.argv[1], "w").write(json.dumps(out, indent=1) + "\n")
    for key, value in values.items():
        print(f"{key:24} {value:.4f}")


if __name__ == "__main__":
    main()
