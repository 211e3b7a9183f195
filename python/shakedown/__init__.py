"""Does this grasp hold? Geometry, simulated trials, ranking and statistics of 6-DoF grasps.

    import shakedown
    result = shakedown.simulate("mug.obj", poses, protocol="acronym", mass_kg=0.3)
    result["held"].mean()

Poses are `object_from_hand`: an array (N, 4, 4), or (N, 7) of x, y, z (metres), qx, qy, qz, qw. They
are poses of the ACRONYM hand frame unless `frame` says "panda_hand" or "tcp".
"""

from ._shakedown import (
    Gripper,
    Protocol,
    ShakedownError,
    __version__,
    classify,
    engine,
    evaluate,
    rank,
    simulate,
)

__all__ = [
    "Gripper", "Protocol", "ShakedownError", "__version__", "classify", "engine", "evaluate",
    "rank", "simulate",
]
