"""Values go back into URDF and MJCF files as their makers publish them: own values leave every
byte, others change numbers alone, torques are the estimate's.

UR5e comes with airo-models and three MJCF models with gymnasium (test extra). Panda, Kinova and
Talos are read where example-robot-data is installed, further arms wherever `SYMGEN_ROBOTS` names
folders that hold such packages (pybullet_data for the iiwa, robosuite for MJCF arms).
"""

import os
import sysconfig
from pathlib import Path

import numpy as np
import pytest
from campaign import campaign

import runtime
import symgen
from oracles.applying import exact, motion, other_values, skeleton, torques_of
from symgen.description.files import read_robot

FOLDERS = [
    Path(folder)
    for folder in (
        sysconfig.get_paths()["purelib"],
        *filter(None, os.environ.get("SYMGEN_ROBOTS", "").split(os.pathsep)),
    )
]
DATA = "cmeel.prefix/share/example-robot-data/robots/"
FILES = {  # path in a package, joints that are held
    "airo_models/arms/ur5e/ur5e.urdf": {},
    f"{DATA}panda_description/urdf/panda.urdf": {"panda_finger_joint1": 0.02},
    f"{DATA}kinova_description/robots/kinova.urdf": {},
    f"{DATA}talos_data/robots/talos_left_arm.urdf": {},
    "pybullet_data/kuka_iiwa/model.urdf": {},
    "gymnasium/envs/mujoco/assets/reacher.xml": {},
    "gymnasium/envs/mujoco/assets/pusher.xml": {},
    "gymnasium/envs/mujoco/assets/inverted_double_pendulum.xml": {},
    "robosuite/models/assets/robots/panda/robot.xml": {},
    "robosuite/models/assets/robots/iiwa/robot.xml": {},
    "robosuite/models/assets/robots/ur5e/robot.xml": {},
    "robosuite/models/assets/robots/kinova3/robot.xml": {},
}
SOON = ("ur5e.urdf", "reacher.xml")
HERE = [
    (path, lock)
    for file, lock in FILES.items()
    for folder in FOLDERS
    if (path := folder / file).is_file()
]
CASES = [
    pytest.param(
        path,
        lock,
        id="-".join((path.parent.name, path.stem)),
        marks=() if path.name in SOON else campaign,
    )
    for path, lock in HERE
]


def test_files_of_both_formats_are_here() -> None:
    assert {path.suffix for path, _ in HERE} == {".urdf", ".xml"}


@pytest.mark.parametrize(("path", "lock"), CASES)
def test_own_values_leave_every_byte(path: Path, lock: dict[str, float]) -> None:
    model = symgen.model(read_robot(path, lock=lock)[0])
    applied = symgen.apply(exact(model, dict(model.VALUES)), path, lock=lock)
    assert applied.content == path.read_bytes() and not applied.changes and not applied.added


@pytest.mark.parametrize(("path", "lock"), CASES)
def test_other_values_change_numbers_alone(
    path: Path, lock: dict[str, float], tmp_path: Path
) -> None:
    model = symgen.model(read_robot(path, lock=lock)[0])
    estimate = exact(model, other_values(model, 3))
    applied = symgen.apply(estimate, path, lock=lock)
    before = path.read_bytes()
    assert applied.changes and skeleton(applied.content, without=bool(applied.added)) == skeleton(
        before, without=bool(applied.added)
    )
    assert applied.added or skeleton(applied.content) == skeleton(before)
    agrees(
        applied, path, model, estimate.X, tmp_path, motion(len(model.JOINTS), 5, 0.5, 10)[1:], lock
    )


def agrees(applied, path, model, X, folder, states, lock) -> None:
    """The torques of the written file are those of the estimate to 1e-9, by pinocchio or MuJoCo and
    by the file read again.
    """
    written = applied.write(folder / path.name)
    ours = model.inverse_dynamics(*states, X)
    theirs = torques_of(written, model, states, dict(applied.placeless), lock)
    assert np.abs(theirs - ours).max() < 1e-9 * max(1.0, np.abs(ours).max())
    again = symgen.model(read_robot(written, lock=lock)[0])
    chi = again.VALUES | {name: x for name, x in applied.placeless.items() if name in again.VALUES}
    assert np.abs(
        again.inverse_dynamics(*states, again.base_parameters(chi)) - ours
    ).max() < 1e-9 * max(1.0, np.abs(ours).max())


@campaign
@pytest.mark.parametrize(
    ("path", "lock"),
    [pytest.param(*case, id="-".join((case[0].parent.name, case[0].stem))) for case in HERE],
)
def test_a_simulated_record_is_identified_and_applied(
    path: Path, lock: dict[str, float], tmp_path: Path
) -> None:
    """Noise of 1 %, a feasible estimate; its torques are those of the file that is written."""
    model = symgen.model(read_robot(path, lock=lock)[0])
    t, *states = motion(len(model.JOINTS), 1, 12)
    tau = model.inverse_dynamics(*states, model.base_parameters(other_values(model, 2, offset=0.2)))
    noise = np.random.default_rng(1).normal(0, 0.01, tau.shape) * np.abs(tau).max(axis=0)
    study = runtime.Study(
        signals={"lowpass": {"cutoff": 8}},
        estimate={
            "method": "feasible",
            "options": {"prior": "none", "reach": None},
        },
    )
    estimate = runtime.estimate(model, runtime.Record(t, states[0], tau + noise), study)
    applied = symgen.apply(estimate, path, lock=lock)
    agrees(applied, path, model, estimate.X, tmp_path, tuple(x[::100] for x in states), lock)
