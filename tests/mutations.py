"""Seeded faults: each is put into a copy of the checkout, the default tests of its subject run
there, and a table says which test catches it.

    python tests/mutations.py [NUMBER ...]        all faults, or those of these numbers; some 20 s each

A fault is a file, a text that stands in it once, the text in its place, and what it means. A fault
that no test catches ends the script with code 1; so does a text that is no longer there: then
choose the fault anew. Golden files stand last among the tests, since they notice any change.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("symgen", "runtime", "generated", "tests", "docs", "pyproject.toml", "README.md")
EMITTED = ("oracles/test_emitted_agree.py", "oracles/test_loops_agree.py", "cli/test_generate.py")
REGROUPED = (
    "certify/test_certificate.py",
    "regroup/test_formulas.py",
    "regroup/test_loops.py",
    "cli/test_generate.py",
)
SIGNALS = ("core/test_signals.py", "core/test_decimation.py", "core/test_observation.py")
ESTIMATES = ("core/test_estimators.py", "core/test_estimate.py")


@dataclass(frozen=True)
class Fault:
    """One seeded fault, and the test files that should catch it, most independent first."""

    file: str
    old: str
    new: str
    meaning: str
    tests: tuple[str, ...]


FAULTS = (
    # derive
    Fault("symgen/derive/newton_euler.py", "off(1, 2, DV[0][1] - wd[2])", "off(1, 2, DV[0][1] + wd[2])", "sign in U = skew(wd) + skew(w)**2", EMITTED),
    Fault("symgen/derive/newton_euler.py", "a[1] - qd2 * w[0]", "a[1] + qd2 * w[0]", "sign of the Coriolis term of a prismatic joint", EMITTED),
    Fault("symgen/derive/models.py", "-e for k, e in enumerate(d.robot.gravity)", "e for k, e in enumerate(d.robot.gravity)", "gravity turned", EMITTED),
    Fault("symgen/derive/newton_euler.py", "dot((YY, XX - ZZ, XZ, XY, -YZ)", "dot((YY, ZZ - XX, XZ, XY, -YZ)", "sign in w x (J w)", EMITTED),
    Fault("symgen/derive/newton_euler.py", "cross(geometry.P[j], fi)", "cross(fi, geometry.P[j])", "lever of the force on the link before, turned", EMITTED),
    Fault("symgen/derive/geometry.py", "self.turn[f.ant][1] + offset", "self.turn[f.ant][1]", "constant of an angle sum of parallel axes lost", EMITTED),
    Fault("symgen/derive/regressor.py", 'return speed if law == Expression.symbol("qd") else direction', 'return direction if law == Expression.symbol("qd") else speed', "one-sided Coulomb and viscous friction exchanged", EMITTED),
    # regroup
    Fault("symgen/regroup/rules.py", '{("XX", 0): -ONE}', '{("XX", 0): ONE}', "YY goes into XX with the wrong sign", REGROUPED),
    Fault("symgen/regroup/rules.py", "- p[k] * u[m] -", "+ p[k] * u[m] -", "sign in the parallel axis rule", REGROUPED),
    Fault("symgen/derive/geometry.py", "d * A[1][0] + r * A[1][2]", "d * A[1][0] - r * A[1][2]", "y of P_ij with the wrong sign", REGROUPED),
    Fault("symgen/regroup/finite_field.py", "        left[r] = False\n", "", "a row is a pivot twice", REGROUPED),
    Fault("symgen/regroup/regrouping.py", 'FIRST_CHOICE = ("ZZ", "XX", "XY", "XZ", "YZ", "MX", "MY")', 'FIRST_CHOICE = ("XX", "ZZ", "XY", "XZ", "YZ", "MY", "MX")', "another order of preference: other base parameters", REGROUPED),
    Fault("symgen/certify/certificate.py", "not self.failures and self.numeric_valid and all(", "True or all(", "the certificate says yes to everything", REGROUPED),
    # emit
    Fault("symgen/emit/templates/module.py.jinja", "filled.reshape({{ b }}, -1).T", "filled.transpose(0, 2, 1).reshape({{ b }}, -1).T", "rows of W sample by sample instead of joint by joint", EMITTED),
    Fault("symgen/emit/printers.py", '("-" if s.sign * self._name_sign(s.node) < 0 else "") + self.called', '("-" if s.sign < 0 else "") + self.called', "the sign of a name is forgotten where the name is used", EMITTED),
    Fault("symgen/derive/regressor.py", "if place[0] <= place[1]}", "if place[0] < place[1]}", "diagonal of an element's form left out of the table of elements", ("emit/test_physical_tables.py", "cli/test_generate.py")),
    Fault("symgen/emit/c_target.py", '"above({})",\n    "below({})",', '"below({})",\n    "above({})",', "one-sided friction of C in the other direction", ("emit/test_c_target.py",)),
    Fault("symgen/derive/models.py", "d.columns[own][j], _heading", "d.columns[own].get(d.robot.joints[0], d.columns[own][j]), _heading", "an entry of another joint in a row of D", EMITTED),
    # observation
    Fault("runtime/core/signals/filters.py", "np.gradient(x, 1 / rate, axis=0", "np.gradient(x, 2 / rate, axis=0", "velocities half as large", SIGNALS),
    Fault("runtime/core/signals/filters.py", "CUTOFF * rate / (2 * signals.lowpass.hertz)", "CUTOFF * rate / signals.lowpass.hertz", "decimation by twice the factor of eq. (13)", SIGNALS),
    Fault("runtime/core/signals/filters.py", "np.minimum(np.maximum(a, b), shifted[-1])", "np.minimum(np.minimum(a, b), shifted[-1])", "the running median is the smaller of two", SIGNALS),
    Fault("runtime/core/rows/selection.py", "slow <= speed[instants].T", "slow <= speed[instants].max(axis=1)", "low speed judged by the fastest joint", ("core/test_observation.py",)),
    Fault("runtime/core/rows/selection.py", 'np.searchsorted(t, t1, side="right"', 'np.searchsorted(t, t1, side="left"', "the last sample of a window is lost", ("core/test_observation.py",)),
    Fault("runtime/core/rows/prepared.py", "median_filtered(tau, selection.signals.torque_median)", "tau", "torques without their median filter", ("core/test_observation.py", "core/test_cestac.py")),
    Fault("runtime/core/rows/factor.py", "R=joint.R * w)", "R=joint.R * w**2)", "weights of the joints squared", ESTIMATES),
    Fault("runtime/core/rows/observation.py", "start = sum(self.rows[:j])", "start = sum(self.rows[: j + 1]) - self.rows[0]", "rows of a joint looked for at another place", ("core/test_observation.py", *ESTIMATES)),
    # model: units and drives
    Fault("runtime/core/drives.py", "* self.torque_constant) @ self._matrix", "/ self.torque_constant) @ self._matrix", "divided by torque constants", ("core/test_drives.py",)),
    Fault("runtime/core/drives.py", "self._checked(qm).T).T + self.offset", "self._checked(qm).T).T - self.offset", "offset of the joints with the wrong sign", ("core/test_drives.py",)),
    # estimators
    Fault("runtime/core/least_squares/linear.py", "freedom = system.weighted.rows - fit.rank", "freedom = system.weighted.rows", "degrees of freedom of sigma_rho, eq. (9)", ESTIMATES),
    Fault("runtime/core/least_squares/linear.py", "else sigma_rho**2)", "else sigma_rho)", "covariance of eq. (10) by the deviation in place of the variance", ESTIMATES),
    Fault("runtime/core/least_squares/wls.py", "system, weighted=raw.weighted(1 / scales), scales=tuple(scales), known", "system, weighted=raw.weighted(scales), scales=tuple(scales), known", "noisy joints weigh more", ("core/test_estimators.py",)),
    Fault("runtime/robust.py", "(1 - (u / tuning) ** 2) ** 2, 0.0)", "1 - (u / tuning) ** 2, 0.0)", "weight function of Tukey without its square", ("test_robust.py",)),
    Fault("runtime/core/least_squares/block_covariance.py", "(g[others] / (1 - share[others]))", "g[others]", "leverage of a block left out of its deletion", ("core/test_estimators.py", "core/test_trust.py")),
    Fault("runtime/core/essential.py", "np.argmax(relative)", "np.argmin(relative)", "the best known parameter is removed first", ("core/test_essential.py",)),
    Fault("runtime/core/least_squares/solution.py", "T = solve_triangular(factor.R11, np.eye(b))", "T = solve_triangular(factor.R11, np.eye(b)).T", "the inverse of R transposed: covariances of other parameters", ESTIMATES),
)  # fmt: skip


def caught_by(fault: Fault, copy: Path) -> str:
    """The first test that fails with the fault in the copy, and passes without it; empty where all
    pass.
    """
    path = copy / fault.file
    right = path.read_text(encoding="utf-8")
    if right.count(fault.old) != 1:
        return f"? the text stands there {right.count(fault.old)} times"
    path.write_text(right.replace(fault.old, fault.new), encoding="utf-8")
    forget(path)
    try:
        done = tested(copy, [str(Path("tests") / name) for name in fault.tests])
    finally:
        path.write_text(right, encoding="utf-8")
        forget(path)
    found = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    if not found:
        return (
            ""
            if done.returncode == 0
            else f"? pytest ended with {done.returncode}: {done.stdout[-300:]}"
        )
    if tested(copy, [found[1]]).returncode != 0:
        return f"? {found[1]} fails without the fault, too"
    return found[1].removeprefix("tests/")


def tested(copy: Path, tests: list[str]) -> subprocess.CompletedProcess[str]:
    """A run of pytest in the copy, up to the first failure."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(copy),
        "SYMGEN_CACHE": str(copy / "cache"),
        "MPLBACKEND": "Agg",
    }
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-n",
        "0",
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        *tests,
    ]
    return subprocess.run(
        command, cwd=copy, env=environment, capture_output=True, text=True, timeout=600, check=False
    )


def forget(path: Path) -> None:
    """Removes compiled files of a module, which are told apart by second and size alone."""
    for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        compiled.unlink()


def main() -> None:
    numbers = [int(n) for n in sys.argv[1:]] or range(1, len(FAULTS) + 1)
    missed = 0
    print("| | fault | in | caught by |\n|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory(prefix="mutations-") as folder:
        copy = Path(folder) / "checkout"
        for name in COPIED:
            source = ROOT / name
            shutil.copytree(
                source, copy / name, ignore=shutil.ignore_patterns("__pycache__")
            ) if source.is_dir() else shutil.copy(source, copy / name)
        if not os.environ.get("SYMGEN_DATA") and (ROOT.parent / "shared" / "data").is_dir():
            os.environ["SYMGEN_DATA"] = str(ROOT.parent / "shared" / "data")
        for number in numbers:
            fault = FAULTS[number - 1]
            test = caught_by(fault, copy)
            missed += not test or test.startswith("?")
            print(
                (
                    f"| {number} | {fault.meaning} | `{fault.file}` | "
                    f"{f'`{test}`' if test and test[0] != '?' else f'**none** {test}'} |"
                ),
                flush=True,
            )
    if missed:
        sys.exit(f"{missed} faults not caught")


if __name__ == "__main__":
    main()
