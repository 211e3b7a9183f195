"""Types of the module; see `help(shakedown)` for what it is about."""

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str
engine: str

class ShakedownError(ValueError):
    """Input that cannot be used; the message names what and where."""

class Gripper:
    """A hand: a built-in name or a TOML file (copy one of `shakedown grippers show`)."""

    def __init__(self, name: str = "franka_panda") -> None: ...
    @staticmethod
    def names() -> list[str]: ...
    @property
    def name(self) -> str: ...
    @property
    def opening_max_m(self) -> float: ...
    @property
    def tcp_z_m(self) -> float: ...

class Protocol:
    """A preset or a TOML file. Keywords override constants; `solver__iterations=4` is
    `solver.iterations=4` on the command line."""

    def __init__(self, name: str = "acronym", **overrides: Any) -> None: ...
    @staticmethod
    def names() -> list[str]: ...
    @property
    def name(self) -> str: ...
    @property
    def version(self) -> str: ...
    def constants(self) -> dict[str, Any]: ...

Poses = ArrayLike
Mesh = str | PathLike[str]

class Geometry(TypedDict):
    """`class` is "optimal", "collision" or "out_of_reach"; metres; NaN where there is none."""

    collides: NDArray[np.bool_]
    reachable: NDArray[np.bool_]
    closes: NDArray[np.bool_]
    centred: NDArray[np.bool_]
    aligned: NDArray[np.bool_]
    penetration_m: NDArray[np.float64]
    closing_width_m: NDArray[np.float64]

class Trials(Geometry):
    """The columns of `trials.csv` (docs/formats.md); NaN where a trial did not get that far."""

    outcome: list[str]
    held: NDArray[np.bool_]
    slip_linear_m: NDArray[np.float64]
    slip_angular_rad: NDArray[np.float64]
    closing_linear_m: NDArray[np.float64]
    closing_angular_rad: NDArray[np.float64]
    grip_force_n: NDArray[np.float64]
    sim_s: NDArray[np.float64]
    margin_g: NDArray[np.float64]
    p_hold: NDArray[np.float64]

class Ranking(TypedDict):
    """`order` indexes the poses, best first; the others are in that order."""

    order: NDArray[np.int64]
    p_hold: NDArray[np.float64]
    held: NDArray[np.bool_]

def classify(
    mesh: Mesh, poses: Poses, *, gripper: str | Gripper = "franka_panda", frame: str = "acronym",
    threads: int | None = None, scale: float | None = None,
) -> Geometry:
    """What geometry says of each pose: collision, reach, closing. No simulation."""

def simulate(
    mesh: Mesh, poses: Poses, protocol: str | Protocol = "acronym", *,
    gripper: str | Gripper = "franka_panda", frame: str = "acronym", threads: int | None = None,
    scale: float | None = None, mass_kg: float | None = None,
    density_kg_m3: float | None = None, friction: float | None = None,
) -> Trials:
    """Geometry and one trial for each pose, the same bits as `shakedown run` for any `threads`."""

def rank(
    mesh: Mesh, poses: Poses, *, gripper: str | Gripper = "franka_panda", frame: str = "acronym",
    threads: int | None = None, scale: float | None = None, mass_kg: float | None = None,
    density_kg_m3: float | None = None, friction: float | None = None,
) -> Ranking:
    """The poses by their calibrated probability to hold (geometry and one trial of `acronym`)."""

def evaluate(
    objects: Mapping[str, tuple[Mesh, Poses]], protocol: str | Protocol = "acronym", *,
    gripper: str | Gripper = "franka_panda", frame: str = "acronym", threads: int | None = None,
    labels: Mapping[str, Sequence[bool]] | None = None,
    facts: Mapping[str, Mapping[str, float]] | None = None,
) -> dict[str, Any]:
    """The numbers of `summary.json` over some objects: rates with intervals, success@k, agreement
    with `labels`. `facts` holds scale, mass_kg, density_kg_m3 or friction by object."""
