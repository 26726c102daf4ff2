"""Every tool on the same records: `python benchmarks/tools/run.py --work FOLDER [--page PAGE]`.

In FOLDER an environment for each tool is made, by pip, then jobs and answers; PAGE is given the
tables behind its line `<!-- tables -->`. SYMGEN_DATA names the records; records.py says how they
are split and treated. `--tools` and `--cases` take some of them; answers that are there stay.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

for thread in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[thread] = "1"

import numpy as np  # noqa: E402
from feasible import feasible  # noqa: E402
from records import CASES, CUTOFFS, ROBOTS, ROOT, SLOW, Case, Piece, slips, treated  # noqa: E402

from runtime.ground.errors import InputError  # noqa: E402

HERE = Path(__file__).resolve().parent
MARK = "<!-- tables -->"
SLIPPED = ("tx40", "wrist")
Array = np.ndarray
Answer = dict[str, Any]


@dataclass(frozen=True)
class Tool:
    """needs : requirements for pip, into the folder of that name."""

    title: str
    file: str
    environment: str
    needs: tuple[str, ...]
    function: str = "fit"
    options: tuple[float, ...] = (0.0,)
    """Values of the one setting that its users turn, chosen with the cut-off."""
    cutoffs: tuple[float, ...] = CUTOFFS
    slipped: bool = True
    """Whether it is given the records with slips."""
    chooses: bool = False
    """Whether it chooses its cut-off from the record; the one that it is given is not used."""

    @property
    def lines(self) -> int:
        """Lines of the file that are no comment, no docstring and not blank."""
        text = (HERE / f"{self.file}.py").read_text(encoding="utf-8")
        rows: set[int] = set()
        for node in ast.walk(ast.parse(text)):
            prose = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
            if isinstance(node, ast.stmt) and not prose:
                last = node.body[0].lineno - 1 if hasattr(node, "body") else node.end_lineno
                rows |= set(range(node.lineno, max(node.lineno, last or 0) + 1))
        texts = text.splitlines()
        return sum(bool(texts[k - 1].strip()) and '"""' not in texts[k - 1] for k in rows)


SYMGEN = (f"{ROOT}[mjcf]",)
TOOLS = {
    "symgen": Tool("symgen", "tool_symgen", "symgen", SYMGEN),
    "symgen-default": Tool(
        "symgen, default settings",
        "tool_symgen_default",
        "symgen",
        SYMGEN,
        cutoffs=(20.0,),
        chooses=True,
    ),
    "symgen-ls": Tool("symgen, least squares", "tool_symgen", "symgen", SYMGEN, "least_squares"),
    "figaroh": Tool(
        "figaroh 1.0.2", "tool_figaroh", "figaroh", ("figaroh==1.0.2",), options=(0.0, 1e-4, 1e-3)
    ),
    "pinocchio": Tool(
        "pinocchio + lstsq",
        "tool_pinocchio",
        "pinocchio",
        ("pin==4.1.0",),
        options=(1e-6, 1e-4, 1e-3),
    ),
    "aurt": Tool("AURT 0.0.4", "tool_aurt", "aurt", ("aurt==0.0.4",)),
    "flobaroid": Tool(
        "FloBaRoID's method, own text",
        "tool_flobaroid",
        "flobaroid",
        ("pin==4.1.0", "cvxpy", "clarabel"),
    ),
    "mujoco": Tool(
        "mujoco 4.0.0, sysid",
        "tool_mujoco",
        "mujoco",
        ("mujoco[sysid]==4.0.0",),
        cutoffs=(20.0,),  # each fit more takes minutes
        slipped=False,
    ),
}


def environment(tool: Tool, work: Path) -> str:
    """The Python of the tool, made once; what pip says against it is raised as RuntimeError."""
    folder = work / "environments" / tool.environment
    python, log = folder / "bin/python", folder.with_suffix(".log")
    if not log.exists():
        subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
        pip = [str(python), "-m", "pip", "install", "-q", *tool.needs]
        done = subprocess.run(pip, capture_output=True, text=True, check=False)
        log.write_text(done.stderr if done.returncode else "", encoding="utf-8")
    errors = [line for line in log.read_text(encoding="utf-8").splitlines() if "ERROR" in line]
    if errors:
        raise RuntimeError(errors[0])
    return str(python)


class Runs:
    """One tool on one case.

    Parameters
    ----------
    python : str
    folder : Path
        Where jobs and answers lie.
    """

    def __init__(self, tool: Tool, case: Case, python: str, folder: Path) -> None:
        self.tool, self.case, self.python, self.folder = tool, case, python, folder
        folder.mkdir(parents=True, exist_ok=True)
        self.robot, self.urdf = folder / f"robot.{case.suffix}", folder / "robot.urdf"
        self.robot.write_text(case.robot, encoding="utf-8")
        self.urdf.write_text(case.urdf(), encoding="utf-8")
        self.table = case.table()
        if case.exact:
            self.states, self.truth = case.exact[:3], case.exact[3]
        else:
            *states, self.truth = treated(case.test, case.score)
            self.states = tuple(states)

    def job(
        self,
        name: str,
        train: tuple[Piece, ...],
        knobs: tuple[float, float],
        states: Any,
        *,
        final: bool = False,
    ) -> None:
        cutoff, option = knobs
        q, qd, qdd, tau = treated(train, cutoff)
        np.savez(
            self.folder / f"{name}.npz",
            **dict(zip(("q", "qd", "qdd", "tau"), (q, qd, qdd, tau), strict=True)),
            t=np.concatenate([p.t for p in train]),
            raw_q=np.concatenate([p.q for p in train]),
            raw_tau=np.concatenate([p.tau for p in train]),
            lengths=[len(p.t) for p in train],
            slow=SLOW * np.abs(qd).max(axis=0),
            coupled=self.case.coupled,
            cutoff=cutoff,
            option=option,
            final=final,
            robot=str(self.robot),
            urdf=str(self.urdf),
            mdh=self.table,
            gravity=[
                g.value(self.case.description.constants) for g in self.case.description.gravity
            ],
            states=np.stack(states),
        )

    def run(self) -> dict[str, Answer]:
        """Answers of all jobs in the folder."""
        command = [self.python, str(HERE / "worker.py"), self.tool.file, self.tool.function]
        own = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
        if not all(p.with_suffix(".json").exists() for p in self.folder.glob("*.npz")):
            subprocess.run([*command, str(self.folder)], env=own, check=False)
        return {
            p.stem: json.loads(p.with_suffix(".json").read_text())
            if p.with_suffix(".json").exists()
            else {"error": "the process ended", "said": ""}
            for p in self.folder.glob("*.npz")
        }

    def tuned(self) -> tuple[float, float]:
        """Cut-off and option by which a fit of one half predicts the other best, both ways; raises
        RuntimeError with what the tool said where no fit does.
        """
        halves, score = self.case.halves(), self.case.score or 20.0
        rate = (len(halves[0].t) - 1) / (halves[0].t[-1] - halves[0].t[0])
        cutoffs = [f for f in self.tool.cutoffs if f < 0.4 * rate]
        knobs = [(f, option) for f in cutoffs for option in self.tool.options]
        if len(knobs) == 1:
            return knobs[0]
        truth = []
        for k in (0, 1):
            *states, tau = treated((halves[1 - k],), score)
            truth.append(tau)
            for i, one in enumerate(knobs):
                self.job(f"half{k}_{i}", (halves[k],), one, states)
        answers = self.run()
        errors = {}
        for i, one in enumerate(knobs):
            both = [answers[f"half{k}_{i}"] for k in (0, 1)]
            if all("predicted" in answer for answer in both):
                parts = [relative(tau, a["predicted"]) for tau, a in zip(truth, both, strict=True)]
                errors[one] = float(np.sum(np.square(parts)))
        if not errors:
            raise RuntimeError(answers["half0_0"].get("error", "no fit predicts"))
        return min(errors, key=errors.__getitem__)

    def results(self) -> Answer:
        case = self.case
        try:
            knobs = self.tuned()
        except RuntimeError as e:
            return {"error": str(e)}
        rng = np.random.default_rng(1)
        size = [np.abs(x).max(axis=0) for x in self.states]
        random = [s * rng.uniform(-1, 1, (400, len(s))) for s in size]
        both = [np.concatenate(pair) for pair in zip(self.states, random, strict=True)]
        self.job("final", case.train, knobs, both, final=True)
        final = self.run()["final"]
        row: Answer = {k: final.get(k) for k in ("error", "seconds", "memory")}
        row |= {} if self.tool.chooses else {"knobs": knobs}
        if "predicted" not in final:
            return row
        slipped = case.name in SLIPPED and self.tool.slipped
        for k, train in enumerate(case.repeats if final["values"] else ()):
            self.job(f"repeat{k}", train, knobs, self.states)
        for k, piece in enumerate(slips(case.train[0]).values() if slipped else ()):
            self.job(f"slip{k}", (piece,), knobs, self.states, final=True)
        answers = self.run()
        K, torque = len(self.truth), np.array(final["predicted"])
        row["joints"] = relative(self.truth, torque[:K]).tolist()
        row["whole"] = norm(self.truth - torque[:K]) / norm(self.truth)
        row["feasible"] = feasible(str(self.urdf), case.coupled, random, torque[K:])
        repeats = [a["values"] for name, a in answers.items() if name[0] == "r" and a.get("values")]
        row["spread"] = spread(repeats)
        if slipped:
            row["slips"] = [
                said(final, answers[f"slip{k}"]) for k in range(len(slips(case.train[0])))
            ]
        return row


def norm(x: Array) -> float:
    return float(np.linalg.norm(x))


def relative(truth: Array, predicted: Any) -> Array:
    """Error of each joint beside the rms of its torque."""
    left = np.linalg.norm(truth - np.asarray(predicted), axis=0)
    return np.asarray(left / np.linalg.norm(truth, axis=0))


def spread(fits: list[dict[str, list[float]]]) -> float | None:
    """Median over parameters of the scatter between fits beside what they state."""
    if len(fits) < 3:
        return None
    ratios = []
    for name in set.intersection(*(set(fit) for fit in fits)):
        X, s = np.array([fit[name] for fit in fits]).T
        if np.all(s > 0) and np.all(np.isfinite(s)):
            ratios.append(np.std(X, ddof=1) / np.sqrt(np.mean(s**2)))
    return float(np.median(ratios)) if ratios else None


CAUSES = (
    r"joint 2\b.*(twice|half|2\.0|0\.50|factor of 2)|(twice|half|2\.0|0\.50).*joint 2\b"
    r"|joint 2 must be multiplied by 0\.[45]",
    r"degree|\bdeg\b",
    r"(joints|columns|torques)( of)?( joints)? (1 and 2|2 and 1)|swapped|exchanged",
    r"(sign|axis|turns|direction).*joint 2\b|joint 2\b.*(sign|axis|turns|direction|wrong way)",
    r"\blate by|delay|\b(19|20|21)(\.\d+)? ms",
)
"""What names each slip, in the order of `slips`."""


def said(right: Answer, slipped: Answer) -> list[str]:
    """What the tool says of a slipped record and not of the right one, numbers apart."""
    if slipped.get("error"):
        return [slipped["error"]]
    usual = {plain(line) for line in right["said"].splitlines()}
    new = slipped["said"].splitlines()
    return [line.strip() for line in new if plain(line) not in usual and line.strip()]


def plain(line: str) -> str:
    return re.sub(r"[-+]?\d[\d.,e+-]*|nan|inf|-{3,}", "#", re.sub(r"\s+", " ", line.strip()))


def verdict(lines: list[str], cause: str) -> str:
    """Whether words, not a table of numbers, name the cause."""
    words = [line for line in lines if not number(line)]
    if lines and lines[0].startswith("TimeoutError"):
        return "not run"
    if any(re.search(cause, line, re.IGNORECASE) for line in words):
        return "named"
    if words:
        return "other words"
    return "numbers alone" if lines else "nothing"


def number(line: str) -> bool:
    """Whether a line is a name beside numbers."""
    return re.fullmatch(r"[\w +*.()-]+ +-?[\d.]+%?", line) is not None


def table(head: list[str], rows: list[list[str]]) -> list[str]:
    return ["| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows)] + [""]


def percent(x: float) -> str:
    return f"{100 * x:.3g}"


def tables(rows: dict[str, dict[str, Answer]], missing: dict[str, str]) -> str:
    """The tables of the page; what depends on the machine comes last."""
    names = [name for name in TOOLS if any(name in row for row in rows.values())]
    title = {name: tool.title for name, tool in TOOLS.items()}

    def by_tool(heading: str, show: Callable[[Answer], str], cases: Iterable[str] = rows) -> None:
        lines = [[title[k], *(show(rows[c].get(k, {})) for c in cases)] for k in names]
        out.extend([f"### {heading}", "", *table(["tool", *cases], lines)])

    out = ["### Where symgen is not the best", "", *worse(rows, title), ""]
    by_tool(
        "Error on unseen data, % of the rms torque",
        lambda row: percent(row["whole"]) if "whole" in row else "-",
    )
    out += [f"- {title[k]} was not installed: {text}" for k, text in missing.items()]
    for name in names:
        cases: dict[str, list[str]] = {}
        for case, row in rows.items():
            if error := row.get(name, {}).get("error"):
                cases.setdefault(" ".join(error.split()), []).append(case)
        out += [f"- {title[name]}, {', '.join(own)}: {error}" for error, own in cases.items()]
    out += ["", "### By joint, %", ""]
    for case, row in rows.items():
        own = [name for name in names if "joints" in row.get(name, {})]
        count = len(row[own[0]]["joints"]) if own else 0
        lines = [[title[k], *map(percent, row[k]["joints"])] for k in own]
        out += table([case, *(str(j + 1) for j in range(count))], lines)
    by_tool("A physical robot can have the parameters", lambda row: row.get("feasible", "-"))
    by_tool(
        "Scatter between records beside the deviation that is stated",
        lambda row: f"{row['spread']:.2f}" if row.get("spread") else "-",
        [case for case in rows if case == "go2" or case in ROBOTS],
    )
    by_tool(
        "The cut-off that each chose, Hz (and its setting)",
        lambda row: (
            f"{row['knobs'][0]:g}" + (f" ({row['knobs'][1]:g})" if row["knobs"][1] else "")
            if "knobs" in row
            else "-"
        ),
    )
    out += ["### Five slips in the record", ""]
    for case in (case for case in SLIPPED if case in rows):
        slipped = {k: row["slips"] for k in names if "slips" in (row := rows[case].get(k, {}))}
        listed = list(enumerate(slips(CASES[case]().train[0])))
        lines = [
            [slip, *(verdict(told[i], CAUSES[i]) for told in slipped.values())]
            for i, slip in listed
        ]
        out += table([case, *(title[k] for k in slipped)], lines)
        out += ["What they said, at most three lines each:", ""]
        for i, slip in listed:
            for k, told in slipped.items():
                words = [line[:160] for line in told[i] if not number(line)][:3]
                out += [f"- {slip}, {title[k]}: {' / '.join(words)}"] if words else []
        out += [""]
    by_tool(
        "Seconds of processor and peak memory (MB) of one fit",
        lambda row: f"{row['seconds']:.2g}, {row['memory']:.0f}" if row.get("seconds") else "-",
    )
    out += ["Lines that a user writes: " + ", ".join(f"{title[k]} {TOOLS[k].lines}" for k in names)]
    return "\n".join(out) + ".\n"


def worse(rows: dict[str, dict[str, Answer]], title: dict[str, str]) -> list[str]:
    """Cases that others predict better, and the joints where symgen is worse than the best."""
    lines = []
    for case, row in rows.items():
        whole = {k: answer["whole"] for k, answer in row.items() if "whole" in answer}
        ranked = sorted(whole, key=whole.__getitem__)
        better = ranked[: ranked.index("symgen")] if "symgen" in whole else []
        if better:
            own, other = (np.array(row[k]["joints"]) for k in ("symgen", better[0]))
            joints = ", ".join(str(j + 1) for j in np.flatnonzero(own > 1.05 * other)) or "none"
            errors = ", ".join(f"{title[k]} {percent(whole[k])} %" for k in [*better, "symgen"])
            lines.append(f"- {case}: {errors}; joints worse by more than a twentieth: {joints}")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--page", type=Path)
    parser.add_argument("--tools", nargs="*", default=list(TOOLS), choices=list(TOOLS))
    parser.add_argument("--cases", nargs="*", default=list(CASES), choices=list(CASES))
    arguments = parser.parse_args()
    rows: dict[str, dict[str, Answer]] = {}
    missing: dict[str, str] = {}
    pythons: dict[str, str] = {}
    for name in arguments.tools:
        try:
            pythons[name] = environment(TOOLS[name], arguments.work)
        except RuntimeError as e:
            missing[name] = str(e)
    for case_name in arguments.cases:
        try:
            case = CASES[case_name]()
        except (InputError, OSError) as e:
            sys.exit(f"{case_name}: {e}")
        rows[case_name] = {}
        for name, python in pythons.items():
            folder = arguments.work / "jobs" / case_name / name
            begun = time.monotonic()
            rows[case_name][name] = Runs(TOOLS[name], case, python, folder).results()
            print(f"{case_name}: {TOOLS[name].title}, {time.monotonic() - begun:.0f} s", flush=True)
    text = tables(rows, missing)
    (arguments.work / "tables.md").write_text(text, encoding="utf-8")
    if arguments.page:
        before = arguments.page.read_text(encoding="utf-8").partition(MARK)[0]
        arguments.page.write_text(f"{before}{MARK}\n\n{text}", encoding="utf-8")


if __name__ == "__main__":
    main()
