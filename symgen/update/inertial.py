"""Mass, centre and inertia about the centre of a link, as its file states them, from ten parameters in the frame of its body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symgen.description.tree import Array
from symgen.errors import DescriptionError


@dataclass(frozen=True)
class Quantity:
    """Numbers of one kind of a link or joint.

    Attributes
    ----------
    name, unit : str
        What they are.
    labels : tuple of str
        What each is called in the file.
    values : tuple of float
        Themselves.
    """

    name: str
    unit: str
    labels: tuple[str, ...]
    values: tuple[float, ...]


def about_centre(ten: Array, X: Array, R: Array) -> tuple[float, Array, Array]:
    """M, c in the link frame, I about c along axes of orientation R in the link frame; the link has pose X, (4, 4), in frame j of `ten`."""
    *J, mx, my, mz, M = (float(x) for x in ten)
    if M <= 0:
        if np.any(ten):
            raise DescriptionError(f"a mass of {M:.4g} kg comes out; no link has it")
        return 0.0, np.zeros(3), np.zeros((3, 3))
    c = np.array([mx, my, mz]) / M
    I = np.zeros((3, 3))
    I[np.triu_indices(3)] = J
    I = I + I.T - np.diag(np.diag(I)) - M * (c @ c * np.eye(3) - np.outer(c, c))
    turned = X[:3, :3] @ R
    return M, X[:3, :3].T @ (c - X[:3, 3]), turned.T @ I @ turned
