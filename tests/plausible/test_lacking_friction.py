"""Robot files without friction beside records that show it."""

from __future__ import annotations

import numpy as np
import planar_arm
import pytest

import runtime

QUESTION = "Does the robot file have the friction of the joints?"
WITHOUT = planar_arm.text_of("", "")


def judged(text, run):
    """The identification of a record by a robot file, and its answer on friction."""
    model = planar_arm.arm(text)
    result = runtime.identify(model, run, planar_arm.study(), plausible=True)
    answers = [c for c in result.checklist.checks if c.question == QUESTION]
    return result, answers[0] if answers else None


@pytest.fixture(scope="module")
def rubbing():
    """A record of an arm whose friction is most of its torque."""
    model = planar_arm.arm()
    values = {name: model.VALUES[name] for name in model.STANDARD_PARAMETERS}
    strong = values | {"FS1": 20.0, "FV1": 10.0, "FS2": 6.0, "FV2": 3.0}
    return planar_arm.record(model, 0, model.base_parameters(strong))


def test_a_file_without_friction_is_the_first_doubt(rubbing):
    """ "The values leave 94 % unexplained (with fitted friction)": none was fitted."""
    result, answer = judged(WITHOUT, rubbing)
    assert answer.state == "no" and answer.finding.startswith(
        "The robot file has no friction: add FV, FS"
    )
    assert result.checklist.doubt.startswith(QUESTION) and "FV: {kind: viscous" in answer.remedy
    assert "with fitted friction" not in str(result)
    known = result.part("plausibility").robot_values
    np.testing.assert_allclose([*known.gravity, *known.inertia], 1.0, atol=0.05)


def test_a_file_with_friction_is_not_asked(rubbing):
    result, answer = judged(planar_arm.text_of(), rubbing)
    assert answer is None and result.checklist.state == "good", result.checklist.doubt


def test_one_joint_without_friction_is_named(rubbing):
    text = planar_arm.text_of(
        "\n  FV: {kind: viscous, along: 1}\n  FS: {kind: coulomb, along: 1}",
        ", FV1: 0.5, FS1: 0.8",
    )
    _, answer = judged(text, rubbing)
    assert "no friction of joint 2: add FV, FS" in answer.finding


def test_a_record_without_friction_needs_none():
    model = planar_arm.arm(WITHOUT)
    offset = planar_arm.record(model, 0)
    offset = runtime.Record(offset.t, offset.q, offset.tau + [2.0, 1.0], rate=planar_arm.RATE)
    for run in (planar_arm.record(model, 0), offset):
        assert judged(WITHOUT, run)[1].state == "good"
