"""Variants of a robot whose base moves: another geometry without another derivation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import symgen
from symgen.description import load_robot
from symgen.description.expression import Expression
from symgen.errors import DescriptionError


@pytest.mark.parametrize("base", ["moving", "free"])
def test_a_variant_is_the_robot_of_another_geometry(base):
    """Torques of all standard parameters: frame 2 turned and shifted in the file, and by keywords."""
    robot, rng = load_robot("planar_2r"), np.random.default_rng(0)
    alpha, d = Expression.number("0.3"), Expression.number("0.7")
    frames = (robot.frames[0], replace(robot.frames[1], alpha=alpha, d=d))
    other = symgen.model(replace(robot, frames=frames), base=base)
    variants = symgen.variants("planar_2r", base=base)
    motion, q, qd, qdd = rng.normal(size=(5, 9)), *rng.normal(size=(3, 5, 2))
    chi = rng.normal(size=len(variants.STANDARD_PARAMETERS))
    D = variants.regressor(motion, q, qd, qdd, free_alpha2=0.3, free_d2=0.7)
    assert base == variants.BASE
    assert variants.STANDARD_PARAMETERS == other.STANDARD_PARAMETERS
    tau = other.inverse_dynamics(motion, q, qd, qdd, other.base_parameters(chi))
    assert np.abs(D @ chi - tau).max() < 1e-12 * np.abs(tau).max()
    # the angle of gravity is not a constant of any function: a0 has it
    turned = variants.regressor(motion, q, qd, qdd, free_alpha2=0.3, free_d2=0.7, free_gx=3.0)
    assert (turned == D).all()


def test_a_base_that_is_none_is_refused():
    with pytest.raises(DescriptionError, match="base 'flying'"):
        symgen.variants("planar_2r", base="flying")
