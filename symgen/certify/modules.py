"""Certify emitted source files before they are returned or imported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

from symgen.certify.certificate import Certificate, certify_formulas, hair_off
from symgen.certify.importing import cached_path, stored_path
from symgen.certify.texts import text_check, with_certificate
from symgen.certify.witness import Witness, ungrouped
from symgen.derive.doubts import nearly_round
from symgen.derive.models import OPTIONS
from symgen.description.robot import Robot
from symgen.description.values import WITHIN
from symgen.emit.generate import generate_files
from symgen.emit.targets import TARGETS, target_of
from symgen.errors import CertificateError, require, require_names
from symgen.regroup.regrouping import Regrouping, regroup, regrouping_of
from symgen.time_limit import limited


def certify(
    robot: str | Path | Robot | Regrouping,
    files: Mapping[str, str] | None = None,
    options: Sequence[str] = (),
) -> Certificate:
    """Check the regrouping formulas of a robot and the emitted code, as `symgen check` does.

    Parameters
    ----------
    robot : str, Path, Robot or Regrouping
        A robot as for `symgen.model`, or its base parameters.
    files : mapping, optional
        Source texts by file name. Default: the NumPy module.
    options : sequence of str
        Names of the functions on request that the texts contain.

    Raises
    ------
    DescriptionError
        The loops close in too few random states.

    Examples
    --------
    >>> import symgen
    >>> certificate = symgen.certificate("planar_2r")
    >>> certificate.valid, certificate.count, certificate.rank
    (True, 13, 13)
    """
    regrouping = regrouping_of(robot)
    robot = regrouping.robot
    require_names(options, OPTIONS, "options")
    if files is not None:
        require(files, Mapping, "files", "{file name: text}")
        known = [t.file.format(robot.name, "*") for t in TARGETS.values()]
        strange = {file for file in files if not any(fnmatchcase(str(file), x) for x in known)}
        require_names(strange, known, "files")
        for name, text in files.items():
            require(text, str, f"files[{name!r}]", "the text of the file")
    with limited(f"the certificate of {robot.name}"):
        certificate = certify_formulas(regrouping)
    with limited(f"the derivation of {robot.name}"):
        files = generate_files(robot, regrouping=regrouping) if files is None else files
        witness = Witness(regrouping, options=options)
        texts = {
            file: text_check(file, text, target_of(file), witness, files)
            for file, text in files.items()
        }
    certificate = replace(certificate, texts=texts)
    unsaid = not certificate.valid and not certificate.failures
    if unsaid and nearly_round(robot, WITHIN):
        return replace(certificate, failures=(hair_off(robot, "some columns"),))
    return certificate


def certified_files(
    robot: Robot,
    *,
    targets: Sequence[str] = ("numpy",),
    command: str | None = None,
    options: Sequence[str] = (),
) -> dict[str, str]:
    """Generate the files of a robot, check them, and return {file name: text with certificate}.

    The files are also stored in the cache from which runtime imports modules.

    CertificateError is raised, in one sentence, if the certificate does not hold.
    """
    regrouping = regroup(robot)
    with limited(f"the derivation of {robot.name}"):
        files = generate_files(
            robot, targets=targets, command=command, regrouping=regrouping, options=options
        )
    return _certified(regrouping, files, options)


def _certified(
    regrouping: Regrouping, files: Mapping[str, str], options: Sequence[str] = ()
) -> dict[str, str]:
    certificate = certify(regrouping, files, options)
    require_valid(certificate)
    texts = {
        file: with_certificate(text, certificate.texts[file], certificate.formulas)
        for file, text in files.items()
    }
    for file, text in texts.items():  # runtime runs what lies in the cache
        stored_path(file, text)
    return texts


def require_valid(certificate: Certificate) -> None:
    """Raise CertificateError if a check of the certificate does not hold."""
    if not certificate.valid:
        wrong = [text for holds, text in certificate.checks if not holds]
        reasons = [t for t in certificate.failures if not t.startswith(("column", "rank"))]
        raise CertificateError(
            f"{certificate.name}: a check of the generated module failed "
            f"({[*reasons, *wrong][0]}), so nothing is written; `symgen check` prints every check",
            certificate,
        )


def certified_path(robot: Robot, options: Sequence[str] = ()) -> Path:
    """Return the cache path of the certified Python module of a robot.

    A text that is in the cache is not certified again.
    """
    ((file, text),) = generate_files(robot, options=options).items()
    cached = cached_path(file, text)
    return cached or stored_path(file, _certified(regroup(robot), {file: text}, options)[file])


def ungrouped_path(robot: Robot) -> Path:
    """Return the cache path of a module whose columns are all standard parameters.

    A text that is in the cache is not checked again.
    """
    regrouping = ungrouped(robot)
    ((file, text),) = generate_files(robot, regrouping=regrouping).items()
    if cached := cached_path(file, text):
        return cached
    check = text_check(file, text, "numpy", Witness(regrouping))
    if check.wrong:
        raise CertificateError(
            f"{robot.name}: {', '.join(check.wrong)} of the variant module differ from independent values",
            check,
        )
    return stored_path(file, with_certificate(text, check, "of standard parameters"))
