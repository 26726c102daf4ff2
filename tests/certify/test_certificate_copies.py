"""Robots, regroupings, certificates and errors can be copied and pickled, attributes included."""

from __future__ import annotations

import copy
import pickle

import pytest
from campaign import some

from symgen.certify.modules import certify
from symgen.description import load_robot
from symgen.errors import CertificateError, DescriptionError, ExpressionError, SymgenError
from symgen.regroup.regrouping import regroup

COPIES = (copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x)))  # noqa: S301


@pytest.mark.parametrize("copied", COPIES)
@pytest.mark.parametrize("name", ["tx40", "sr400", "four_bar"])
@some(3)
def test_what_is_derived_is_what_its_copy_is(name: str, copied) -> None:
    robot = load_robot(name)
    regrouping = regroup(robot)
    certificate = certify(regrouping)
    for x in (robot, regrouping, certificate):
        assert copied(x) == x
    assert hash(copied(robot)) == hash(robot) and copied(certificate).valid
    assert str(copied(certificate)) == str(certificate)


@pytest.mark.parametrize("copied", COPIES)
@pytest.mark.parametrize(
    "error",
    [
        SymgenError("what"),
        CertificateError("which check", {"valid": False}),
        DescriptionError("what", path=("frames", 4, "sigma"), file="arm.yaml", line=14),
        ExpressionError("what", text="1 +", column=3, advice="; write 1 + D2"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_errors_keep_their_attributes(error: SymgenError, copied) -> None:
    same = copied(error)
    assert type(same) is type(error) and same.args == error.args and str(same) == str(error)
    assert vars(same) == vars(error)
