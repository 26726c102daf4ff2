"""Friction columns of W that switch with the direction of motion.

The columns are dry friction, and viscous friction of one direction:

f(s) = linear s + jump sign(s) + kink |s| + a constant,  s = G qd
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from runtime.core.model import GeneratedModel, elements_of
from runtime.ground.errors import ModelError

Array = np.ndarray

SHAPES = {
    ("coulomb", "both"): (0.0, 1.0, 0.0),
    ("coulomb", "positive"): (0.0, 0.5, 0.0),
    ("coulomb", "negative"): (0.0, 0.5, 0.0),
    ("viscous", "positive"): (0.5, 0.0, 0.5),
    ("viscous", "negative"): (0.5, 0.0, -0.5),
}
"""linear, jump, kink of the elements of friction that switch."""


@dataclass(frozen=True, eq=False)
class Switch:
    """One column of W, dry or one-sided viscous friction, that switches with the sign of a speed.

    The column acts on joint j as G_j f(s), f(s) = linear s + jump sign(s) + kink |s| + constant.

    column : number of the column in W. G : ndarray, shape (n,).
    """

    column: int
    G: Array
    linear: float
    jump: float
    kink: float

    @property
    def joints(self) -> tuple[int, ...]:
        """Numbers, from 0, of the joints on which this friction column acts."""
        return tuple(int(j) for j in np.flatnonzero(self.G))


def switches(
    model: GeneratedModel,
    names: Sequence[str],
    passive: Literal["refused", "left out"] = "refused",
) -> tuple[Switch, ...]:
    """Find the columns among `names` that switch with the sign of a velocity, such as dry friction.

    Raise ModelError if the model describes no elements.

    passive : whether such a column along a passive joint is refused or left out.
    """
    elements = elements_of(model)
    switching = []
    for column, name in enumerate(names):
        element = elements.get(name, elements.get(name.removesuffix("R")))
        if element is None:
            continue
        kind, direction, along = element
        shape = SHAPES.get((kind, direction))
        if shape is None:
            continue
        strange = [j for j in along if j not in model.JOINTS]
        if strange and passive == "left out":
            continue
        if strange:
            raise ModelError(
                (
                    f"the friction {name} acts along the passive joints {strange}, so the effect "
                    "of rounding on it cannot be predicted; use symgen cestac without --advise"
                ),
                file=model.NAME,
            )
        G = np.array([along.get(j, 0.0) for j in model.JOINTS])
        switching.append(Switch(column, G, *shape))
    return tuple(switching)
