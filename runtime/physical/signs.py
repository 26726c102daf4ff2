"""Size of a robot, computed from the origins of its frames."""

from __future__ import annotations

import numpy as np

from runtime.core.limits import LIMIT
from runtime.core.model import GeneratedModel, joint_units

Array = np.ndarray


def frame_origins(model: GeneratedModel, q: Array) -> Array | None:
    """Compute the origins of all frames in frame 0, m, at the joint positions q, shape (K, n).

    The result has shape (K, frames, 3). It is None if the model has no frame poses, or if a
    kinematic loop does not close.
    """
    poses = getattr(model, "frame_poses", None)
    try:
        with np.errstate(all="ignore"):
            return None if poses is None else np.asarray(poses(q))[:, :, :3, 3]
    except ValueError:
        return None


def reach_of(model: GeneratedModel) -> float:
    """Estimate the size of a robot, m: largest distance between two frames, plus the longest link.

    Random poses are tried. The longest link is added because no frame marks the end of the last
    link. Joints move within their limits; without limits, revolute joints turn anywhere. The result
    is nan if the frames do not show the size: there is a prismatic joint without limits, or fewer
    than two links have a length.
    """
    limits = dict(getattr(model, "LIMITS", None) or {}).get("q")
    units = joint_units(model)
    if limits is None and "m" in units:
        return float("nan")
    spans = (
        np.array([(-np.pi, np.pi)] * len(units))
        if limits is None
        else np.array([(-x, x) if np.ndim(x) == 0 else x for x in limits], dtype=float)
    )
    rng = np.random.default_rng(0)
    q = rng.uniform(spans[:, 0], spans[:, 1], (LIMIT.REACH_POSES, len(spans)))
    origins = frame_origins(model, q)
    if origins is None or origins.shape[1] < 2:
        return float("nan")
    links = np.linalg.norm(np.diff(origins, axis=1), axis=2)
    spread = np.linalg.norm(origins[:, :, None] - origins[:, None], axis=3)
    several = (links.max(axis=0) > 0.1 * links.max()).sum() > 1
    return float(spread.max() + links.max()) if several else float("nan")
