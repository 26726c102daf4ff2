"""Robot files of strangers with fresh lengths and angles, and loops behind turning joints, each
against an oracle that shares no code with the derivation.

    python benchmarks/strange_robots.py files ../shared/robots/*.yaml [--seeds 0:20]
    python benchmarks/strange_robots.py turned [--seeds 0:4] [--draws 24]

`files` replaces every decimal number of a frame table and of its constants: lengths by 0.9 to 1.1
of themselves, decimal angles likewise; one number in two places stays one number. Whole numbers,
fractions of pi and gravity stay. `turned` draws the 18 kinds of tests/oracles/random_loops.py
behind one, two and three hinges, so that 54 mechanisms are a seed. Those of odd seeds have numbers
for lengths and angles; those of even seeds have constants, are derived once and, where their
coefficients are exact, called with the constants of `draws` mechanisms (its own first) by keyword.

Each case (all draws of one derivation) runs in a process of its own with at most LIMIT seconds of
processor time. A case is
  agrees   the certificate holds, inverse dynamics and regressor of the emitted text give the
           torques of Lagrange multipliers (of pinocchio for trees) to TOLERANCE of the largest, and
           the rank of the oracle's regressor is the number of base parameters
           (in the half of the random states that is farthest from dead points; ranks where loops
           are not APART times smaller than the arm that carries them)
  refused  one sentence (SymgenError, or a certificate that says why it does not hold)
  wrong    anything else: other torques, another rank, a traceback, a case without an end
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import collections
import json
import multiprocessing
import os
import re
import resource
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import numpy as np

from oracles.multipliers import Multipliers
from oracles.pinocchio_model import PinocchioModel
from oracles.random_loops import KINDS, random_loop
from oracles.random_robots import random_parameters
from oracles.test_loops_agree import whole
from oracles.test_random_loops import closes, module_of
from symgen.certify.modules import certify
from symgen.derive.loops import close
from symgen.description import Robot, parse_robot
from symgen.emit.generate import generate_module
from symgen.errors import SymgenError
from symgen.regroup.regrouping import Regrouping, regroup

LIMIT = 120  # s of processor time of a case
TOLERANCE = 1e-9  # of the largest torque; states near dead points cost digits of the closure
SAMPLES, APART = 40, 100
FILLED = 1e-9  # of the longest column: shorter ones hold what is left of a closure by Newton
FEWEST, MOST = (
    1e-14,
    1e-9,
)  # singular values of the oracle's regressor, its columns scaled to length
# 1: the last one that counts is above, the next one below, relative to the largest

TRIES = 30

Case = tuple[str, Callable[[], Robot], int, int]  # name, robot, joints before the loop, draws
Constants = dict[str, float]


def redrawn(text: str, seed: int) -> str:
    """The text of a robot file with other decimals in its frames and constants, those of `g` and of
    the tables that follow the frames excepted.
    """
    rng, other = np.random.default_rng([31, seed]), dict[str, str]()

    def fresh(m: re.Match[str]) -> str:
        if m[0] not in other:
            x, digits = float(m[0]), max(len(m[0].partition(".")[2]), 3)
            other[m[0]] = f"{x * rng.uniform(0.9, 1.1):.{digits}f}" if "e" not in m[0] else m[0]
        return other[m[0]]

    decimal = r"(?<![\w.])\d+\.\d+(?:e-?\d+)?"
    lines, section = [], ""
    for line in text.splitlines():
        section = line.split(":")[0] if line[:1].strip() else section
        if section in ("frames", "constants"):
            kept = re.split(r"(\bg\w*: *[\d.]+)", line)
            line = "".join(x if k % 2 else re.sub(decimal, fresh, x) for k, x in enumerate(kept))
        lines.append(line)
    return "\n".join(lines)


def reached(module: Any, q: Any, constants: Constants) -> Any:
    """Those of the states q (N, n) at which the loops close."""
    if closes(module, q, constants):
        return q
    parts = np.array_split(q, 2) if len(q) > 1 else []
    return np.concatenate([q[:0], *(reached(module, part, constants) for part in parts)])


def oracle_of(
    robot: Robot,
    module: Any,
    behind: int,
    rng: np.random.Generator,
    start: Any,
    constants: Constants,
) -> tuple[Any, Any, Any, Any, Any]:
    """q, qd, qdd (N, n), torque and regressor of the oracle for a robot with these constants: loops
    near their start, joints before them and trees at all angles.
    """
    joints, chi = robot.joints, random_parameters(robot, seed=7)
    if not robot.passive:
        model = PinocchioModel(robot)
        q = rng.uniform(-np.pi, np.pi, (SAMPLES, len(joints)))
        qd, qdd = rng.standard_normal((2, *q.shape))
        D = np.array([model.regressor(*one) for one in zip(q, qd, qdd, strict=True)])
        return q, qd, qdd, D @ chi, D
    loop = robot.frames[behind:]
    size = max((abs(e.value(robot.constants)) for f in loop for e in (f.b, f.d, f.r0)), default=1)
    reach = np.array([0.1 * (size or 1) if robot.frame(j).sigma else 0.3 for j in joints])
    reach[:behind] = np.pi
    q = start + reach * rng.uniform(-1, 1, (2 * SAMPLES, len(joints)))
    q = reached(module, q, constants)
    at, zero = whole(robot, q, module.passive_joints(q, **constants)), np.zeros((1, len(joints)))
    if len(q) < SAMPLES // 2:
        raise ArithmeticError(f"{len(q)} of {2 * SAMPLES} states within the reach of the loops")
    order = np.argsort(Multipliers(robot, at[:1], zero, zero).regularity(at))[-(len(q) // 2) :]
    q, at = q[order], at[order]
    qd, qdd = rng.standard_normal((2, *q.shape))
    oracle = Multipliers(robot, at, qd, qdd)
    return q, qd, qdd, oracle.torque(chi), oracle.projected_regressor()


def compared(
    robot: Robot, module: Any, behind: int, found: Regrouping, start: Any, constants: Constants
) -> tuple[str, str]:
    """What becomes of a module that is called with these constants, those of the robot."""
    n, method, rng = len(found), found.method.partition(",")[0], np.random.default_rng(3)
    q, qd, qdd, torque, D = oracle_of(robot, module, behind, rng, start, constants)
    X = module.base_parameters(random_parameters(robot, seed=7), **constants)
    off = max(
        np.abs(tau - torque).max() / np.abs(torque).max()
        for tau in (
            module.inverse_dynamics(q, qd, qdd, X, **constants),
            module.regressor(q, qd, qdd, **constants) @ X,
        )
    )
    W = D.reshape(-1, D.shape[-1])
    length = np.linalg.norm(W, axis=0)
    there = length > FILLED * length.max()
    s = np.linalg.svd(W[:, there] / length[there], compute_uv=False)
    if off > TOLERANCE:
        return "wrong", f"torques off by {off:.1e} of the largest ({method})"
    lengths = [abs(e.value(robot.constants)) for f in robot.frames for e in (f.b, f.d, f.r0)]
    if len(W) >= 2 * n and max(lengths) <= APART * robot.longest:
        last, beyond = (s[k] / s[0] if k < len(s) else 0.0 for k in (n - 1, n))
        if last < FEWEST or beyond > MOST:
            return (
                "wrong",
                f"{n} base parameters, singular values {last:.1e}, {beyond:.1e} ({method})",
            )
    return "agrees", f"{off:.1e} {method}"


def other_constants(
    robot: Robot, module: Any, start: Any, rng: np.random.Generator
) -> tuple[Robot, Constants] | None:
    """Robot with constants whose loops close at their start (n,): H1 ... anew, lengths by 0.7 to
    1.4. Those that the module does not take stay.
    """
    for _ in range(TRIES):
        constants = {
            name: rng.uniform(-1.5, 1.5) if name[0] == "H" else x * rng.uniform(0.7, 1.4)
            for name, x in robot.constants.items()
            if name in module.CONSTANTS
        }
        if closes(module, start, constants):
            return replace(robot, constants={**robot.constants, **constants}), constants
    return None


def verdicts(make: Callable[[], Robot], behind: int, draws: int) -> Iterator[tuple[str, str]]:
    """What becomes of a case and of its draws, and in which words or figures."""
    try:
        robot = make()
        found = regroup(robot)
        text = generate_module(robot)
        certificate = certify(found, {f"{robot.name}.py": text})
    except SymgenError as error:
        yield "refused", str(error)
        return
    if not certificate.valid:
        yield "refused", "; ".join(certificate.failures)
        return
    with TemporaryDirectory() as folder:
        module = module_of(text, Path(folder))
    rng, at = np.random.default_rng(5), close(robot).start if robot.passive else {}
    start = np.array([at.get(j, 0.0) for j in robot.joints])
    for k in range(draws if module.CONSTANTS else 1):
        drawn = other_constants(robot, module, start, rng) if k else (robot, {})
        if drawn is None:
            yield "refused", f"not compared: no other constants closed in {TRIES} draws"
            continue
        try:
            yield compared(drawn[0], module, behind, found, start, drawn[1])
        except ArithmeticError as error:
            yield "refused", f"not compared: {error}"
        except Exception:
            yield "wrong", " | ".join(traceback.format_exc().splitlines()[-3:])


def guarded(case: Case, answer: Any) -> None:
    """Send (outcome, words, seconds) of a case, from a process of its own."""
    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT + 5))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    begun = time.process_time()
    try:
        for outcome in verdicts(*case[1:]):
            answer.send((*outcome, time.process_time() - begun))
    except Exception:
        words = " | ".join(traceback.format_exc().splitlines()[-3:])
        answer.send(("wrong", words, time.process_time() - begun))
    answer.send(None)


def run(cases: Iterator[Case]) -> collections.Counter[str]:
    """Every case, a line of JSON each."""
    context, counts = multiprocessing.get_context("fork"), collections.Counter[str]()
    for case in cases:
        mine, theirs = context.Pipe(duplex=False)
        child = context.Process(target=guarded, args=(case, theirs))
        child.start()
        theirs.close()
        number, ended = 0, False
        while not ended:
            try:
                outcome = mine.recv()
            except EOFError:
                outcome, ended = ("wrong", f"no end within {LIMIT} s", LIMIT), True
            if outcome is None:
                break
            counts[outcome[0]] += 1
            line = [case[0], number, *outcome[:2], round(outcome[2], 1)]
            print(json.dumps(line), flush=True)
            number += 1
        child.join()
    return counts


def files(paths: list[str], seeds: range) -> Iterator[Case]:
    for seed in seeds:
        for path in paths:
            fresh = redrawn(Path(path).read_text("utf-8"), seed)
            yield (
                f"{Path(path).stem} {seed}",
                lambda fresh=fresh, path=path: parse_robot(fresh.encode(), Path(path).name),
                0,
                1,
            )


def turned(seeds: range, draws: int) -> Iterator[Case]:
    for seed in seeds:
        for kind in KINDS:
            for behind in (1, 2, 3):
                yield (
                    f"{kind} behind {behind}, {seed}",
                    lambda k=kind, s=seed, b=behind: random_loop(k, s, behind=b, named=not s % 2),
                    behind,
                    1 if seed % 2 else draws,
                )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("campaign", choices=["files", "turned"])
    parser.add_argument("files", nargs="*", help="robot files")
    parser.add_argument("--seeds", default="0:4", help="first:end")
    parser.add_argument("--draws", default=24, type=int, help="mechanisms of one derivation")
    arguments = parser.parse_args()
    seeds = range(*map(int, arguments.seeds.split(":")))
    cases = (
        files(arguments.files, seeds)
        if arguments.campaign == "files"
        else turned(seeds, arguments.draws)
    )
    print(dict(run(cases)))


if __name__ == "__main__":
    main()
