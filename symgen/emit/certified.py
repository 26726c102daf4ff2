"""Emitted modules evaluated against a dynamics by energies before anything is called valid, and imported.

At random states the text of the NumPy module must give what `derive.lagrange` gives, which shares no code with the recursions, the
regrouping or the printers:

    regressor            the columns of the parameters that the base parameters are called after
    inverse_dynamics     D chi,             X = base_parameters(chi) for random chi
    bias, gravity        D(q, qd, 0) chi,   D(q, 0, 0) chi
    inertia_matrix       second derivatives of the kinetic energy by the joint rates
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

import numpy as np

from symgen.derive.exact import Array
from symgen.derive.time_limit import limited
from symgen.description.files import load_robot
from symgen.description.robot import Robot
from symgen.emit.generate import generate_files
from symgen.emit.header import one_sided_friction_that_absorbs
from symgen.emit.importing import cached_path, imported, stored_path
from symgen.emit.targets import TARGETS
from symgen.errors import CertificateError, SymgenError
from symgen.regroup.certificate import Certificate, certify_formulas, independent
from symgen.regroup.regrouping import Regrouping, regroup

STATES = 5  # for the models that are one column of the regressor each
SMALL = 1e-6  # of the largest entry: regressor columns below are compared with that
PYTHON = tuple(name for name, target in TARGETS.items() if target.file.endswith(".py"))  # targets that Python imports


def certify(regrouping: Regrouping, text: str | None = None) -> Certificate:
    """The certificate of the formulas of `regrouping` and of the module emitted from it: the verdict of `symgen check`.

    Parameters
    ----------
    regrouping : Regrouping
        Base parameters with their formulas.
    text : str, optional
        Text of the NumPy module; emitted from `regrouping` where left out.

    Raises
    ------
    DescriptionError
        The loops close in too few random states.
    """
    with limited(f"the certificate of {regrouping.robot.name}"):
        certificate = certify_formulas(regrouping)
    file = f"{regrouping.robot.name}.py"
    if text is None:
        text = generate_files(regrouping.robot, regrouping=regrouping)[file]
    with TemporaryDirectory(prefix="symgen-") as folder:
        path = Path(folder) / file
        path.write_text(text, encoding="utf-8")
        return replace(certificate, module_errors=module_errors(imported(path), regrouping))


def certified_files(robot: Robot, *, targets: Sequence[str] = ("numpy",), command: str | None = None) -> dict[str, str]:
    """{file name: text} of every target as `generate_files`, once the certificate of `robot` holds.

    Raises CertificateError, in one sentence, where it does not.
    """
    regrouping = regroup(robot)
    files = generate_files(robot, targets=targets, command=command, regrouping=regrouping)
    require_valid(certify(regrouping, files.get(f"{robot.name}.py")))
    return files


def require_valid(certificate: Certificate) -> None:
    """Raise CertificateError unless the certificate holds."""
    if not certificate.valid:
        wrong = [line for line in str(certificate).splitlines()[1:-1] if not line.startswith("ok")]
        reason = next((text for text in certificate.failures if not text.startswith(("column", "rank"))), wrong[0].removeprefix("FALSE "))
        raise CertificateError(
            f"{certificate.name}: the certificate does not hold ({reason}); no module is emitted; `symgen check` prints every check",
            certificate,
        )


def model(robot: str | Path | Robot, *, target: str = "numpy") -> ModuleType:
    """The module of a robot: derived, regrouped, emitted, certified, imported from a cache by content.

    Parameters
    ----------
    robot : str, Path or Robot
        Name of a packaged robot, path of a robot file (.yaml, .par, .urdf, MJCF), or a Robot.
    target : str
        numpy, casadi or xp (arrays of any package).

    Returns
    -------
    module
        What `import` of the emitted file gives; other processes can load the file `__file__` as long as this one lives.

    Raises
    ------
    DescriptionError
        The file cannot be read or describes no robot.
    CertificateError
        The certificate does not hold.
    SymgenError
        The robot has no module of this target.
    """
    robot = robot if isinstance(robot, Robot) else load_robot(robot)
    if target not in PYTHON:
        raise SymgenError(f"target {target!r}; Python imports {', '.join(PYTHON)}; `symgen generate --target c` writes C")
    files = generate_files(robot, targets=(target,))
    if not files:
        raise SymgenError(f"{robot.name}: no {target} module, since its loops are closed by iteration; the NumPy module serves")
    ((file, text),) = files.items()
    path = cached_path(file, text)
    if path is None:  # what lies in the cache has been certified
        require_valid(certify(regroup(robot), text if target == "numpy" else None))
        path = stored_path(file, text)
    module = imported(path)
    if target == "numpy":  # runtime asks for it where it simulates
        vars(module)["casadi_file"] = lambda: str(model(robot, target="casadi").__file__)
    return module


def c_file(robot: str | Path | Robot) -> Path:
    """The C file of a robot, in the cache by content; an empty one of a robot whose loops are closed by iteration, which has none."""
    robot = robot if isinstance(robot, Robot) else load_robot(robot)
    return stored_path(f"{robot.name}.c", generate_files(robot, targets=("c",)).get(f"{robot.name}.c", ""))


def module_errors(module: ModuleType, regrouping: Regrouping) -> dict[str, float]:
    """Largest difference of each function of an emitted module from the dynamics by energies, of the largest entry.

    Regressor columns are compared one by one, torques and the inertia matrix with the largest torque. `gravity` is left out where
    one-sided friction takes in a constant force, which the module leaves out at rest and says so.
    """
    robot = regrouping.robot
    witness = independent(robot)
    chi = np.random.default_rng(6).standard_normal(len(robot.parameters))
    own = [robot.parameters.index(name) for name in regrouping.own]
    X, q, qd = module.base_parameters(chi), witness.q[:STATES], witness.qd[:STATES]
    tau, rest = witness.D @ chi, np.zeros_like(q)

    def torque(qd: Array, qdd: Array) -> Array:
        return np.asarray(witness.model.actuated_regressor(q, qd, qdd) @ chi)

    at_rest = torque(rest, rest)
    A = witness.model.actuated_inertia(q, chi)
    columns = np.abs(witness.D[:, :, own]).max(axis=(0, 1))
    largest = np.abs(tau).max()
    differences = {
        "regressor": (
            module.regressor(witness.q, witness.qd, witness.qdd) - witness.D[:, :, own],
            np.maximum(columns, SMALL * columns.max()),
        ),
        "inverse_dynamics": (module.inverse_dynamics(witness.q, witness.qd, witness.qdd, X) - tau, largest),
        "inertia_matrix": (module.inertia_matrix(q, X) - A, largest),
        "bias": (module.bias(q, qd, X) - torque(qd, rest), largest),
        "gravity": (module.gravity(q, X) - at_rest, largest),
    }
    if one_sided_friction_that_absorbs(regrouping):
        del differences["gravity"]
    return {name: float(np.max(np.abs(difference) / scale)) for name, (difference, scale) in differences.items()}
