"""`symgen check ROBOT`: the certificate, and a numerical check against a dynamics that shares no code with the derivation."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import typer

from symgen.cli.doubts import tell_doubts
from symgen.cli.session import NEGATIVE, reported_errors, single_thread

if TYPE_CHECKING:
    from symgen.description import Robot
    from symgen.regroup.regrouping import Regrouping

TOLERANCE = 1e-9  # relative to the largest entry: rounding of some thousand operations and of the closed loops


def check(
    robot: Annotated[str, typer.Argument(help="Packaged robot or robot file (.yaml, .par, .urdf).")],
    json: Annotated[bool, typer.Option("--json", help="Print the certificate as JSON.")] = False,
) -> None:
    """Verify the base parameters of ROBOT: exact rank, identities at fresh geometry, numeric rank and torques by CasADi energies."""
    single_thread()
    with reported_errors():
        from symgen.description import load_robot
        from symgen.regroup.certificate import certify
        from symgen.regroup.regrouping import regroup

        described = load_robot(robot)
        tell_doubts(described)
        regrouping = regroup(described)
        document = certify(regrouping).mapping() | {"method": regrouping.method} | numeric(regrouping)
        document["valid"] = document["valid"] and document["numeric_valid"]
        typer.echo(as_json(document) if json else as_text(regrouping, document))
    if not document["valid"]:
        raise typer.Exit(NEGATIVE)


def numeric(regrouping: Regrouping) -> dict[str, Any]:
    """Rank of an independent float regressor by SVD, and the largest torque error of the formulas on it."""
    import numpy as np

    from symgen.derive.lagrange import numeric_regressor
    from symgen.regroup.certificate import numeric_rank

    robot = regrouping.robot
    W, names = numeric_regressor(in_one_mode(robot), 3 * len(robot.parameters) // len(robot.joints) + 10, seed=5)
    rank, gap = numeric_rank(W)
    chi = np.random.default_rng(6).standard_normal(len(names))
    value = dict(zip(names, chi, strict=True))
    X = np.array([sum(c.value(robot.constants) * value[p] for p, c in b.combination.items()) for b in regrouping.base])
    tau = W @ chi
    error = float(np.abs(tau - W[:, [names.index(own) for own in regrouping.own]] @ X).max() / np.abs(tau).max())
    return {
        "numeric_rank": rank,
        "numeric_gap": gap,
        "torque_error": error,
        "numeric_valid": rank == len(regrouping) and error < TOLERANCE,
    }


def in_one_mode(robot: Robot) -> Robot:
    """`robot` with its passive joints declared where they are linear in the actuated ones, so that no state lands in an anti-parallelogram.

    The independent dynamics still closes every loop itself and refuses states in which the declared joints do not.
    """
    from symgen.derive.loops import close
    from symgen.description.expression import Expression

    closure = close(robot)
    if closure.tied:
        return robot
    declared = {j: sum((g * Expression.symbol(f"q{i}") for i, g in closure.row[j].items()), closure.offset[j]) for j in robot.passive}
    return replace(robot, constraints=declared)


def as_json(document: dict[str, Any]) -> str:
    import json
    import math

    return json.dumps({k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in document.items()}, indent=2)


def as_text(regrouping: Regrouping, document: dict[str, Any]) -> str:
    """The certificate, a line per statement."""

    def mark(holds: bool) -> str:
        return "ok   " if holds else "FALSE"

    exact_rank = document["rank"] == document["count"]
    where = f"modulo {' and '.join(map(str, document['primes']))}" if document["primes"] else "in 60 digits"
    false = [text for text in document["failures"] if text.startswith("column")]
    lines = [
        f"{regrouping.robot.name}: {document['count']} base parameters of {len(regrouping.robot.parameters)}, {document['method']}",
        f"{mark(exact_rank)} rank of the base columns {where}: {document['rank']}",
        f"{mark(not false)} {document['identities']} column identities at fresh lengths and states",
        f"{mark(document['numeric_rank'] == document['count'])} rank of the CasADi regressor by SVD: {document['numeric_rank']} (gap {document['numeric_gap']:.1e})",
        f"{mark(document['torque_error'] < TOLERANCE)} torques of the base parameters against CasADi: {document['torque_error']:.1e} of the largest",
    ]
    return "\n".join([*lines, *document["failures"], "certificate " + ("valid" if document["valid"] else "FALSE")])
