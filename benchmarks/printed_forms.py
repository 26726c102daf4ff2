"""Every printed equation against the graph, and mutants of every printer that the reader refuses.

    python benchmarks/printed_forms.py [--mutants 200] [--robots NAME ...]      writes benchmarks/printed_forms.md

Robots, models and forms are those of tests/forms: the packaged robots and those of
tests/forms/robots. Each equation is read from the printed text and evaluated at random numbers,
those of a recursion with numbers of their own for its intermediate variables; emitted files are run
and compared with Lagrange's equations. A mutant is an equation with one change.
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "support")]

from forms.mutants import Mutant, of_files, of_forms
from forms.printed import formula_forms
from forms.test_forms import LANGUAGES, OTHERS, ROBOTS, forms_of, regrouping_of

from symgen.certify.texts import text_check
from symgen.certify.witness import Witness
from symgen.derive.models import SYMBOLIC
from symgen.emit.generate import generate_files

TABLE = ROOT / "benchmarks" / "printed_forms.md"
MUTATED = (("scara", "inverse_dynamics"), ("geared", "inertia_matrix"), ("roots", "bias"))
MUTATED += (("laws", "regressor"), ("four_bar", "closure"), ("two_branch", "coriolis"))
HEAD = """# Every printed form against the graph

`python benchmarks/printed_forms.py` writes these tables: each equation of each form of {robots} robots ({others} beside the packaged ones, in `tests/forms/robots`) is read and evaluated at random numbers.
Closed forms have at most 1000 terms. Functions of emitted files are run at random states and compared with Lagrange's equations.

| form | robots | equations | wrong |
|---|---|---|---|
"""
MUTANTS = """
A mutant is one equation with one change; a mutant of an emitted file is one line, of those whose value the results depend on.

| printer | mutants | refused | of each kind |
|---|---|---|---|
"""


def equations(robots: list[str]) -> list[str]:
    total: dict[str, Counter[str]] = {}
    for robot in robots:
        start = time.process_time()
        found = [("formulas, " + form.name, form) for form in formula_forms(regrouping_of(robot))]
        for model in SYMBOLIC:
            found += [(form.name, form) for form in forms_of(robot, model)]
        seen = set()
        for name, form in found:
            wrong = form.wrong()
            count = total.setdefault(name, Counter())
            count += Counter(equations=len(form.equations), wrong=len(wrong))
            total[name] = count
            if form.equations:
                seen.add(name)
            if wrong:
                print(f"{robot}: {name}: {wrong[:5]}", flush=True)
        for name in seen:
            total[name]["robots"] += 1
        for target, file in (
            ("numpy", f"{regrouping_of(robot).robot.name}.py"),
            ("c", f"{regrouping_of(robot).robot.name}.c"),
        ):
            regrouping = regrouping_of(robot)
            text = generate_files(regrouping.robot, targets=(target,), regrouping=regrouping)[file]
            check = text_check(file, text, target, Witness(regrouping))
            count = total.setdefault(
                f"functions of {'Python' if target == 'numpy' else 'C'}, run", Counter()
            )
            count.update(robots=1, equations=len(check.errors), wrong=len(check.wrong))
            if check.wrong:
                print(f"{file}: {check.wrong}", flush=True)
        print(f"{robot}: {time.process_time() - start:.0f} s", flush=True)
    order = sorted(total)
    rows = [
        f"| {n} | {total[n]['robots']} | {total[n]['equations']} | {total[n]['wrong']} |"
        for n in order
    ]
    every = sum(total.values(), Counter())
    return [*rows, f"| all | {len(robots)} | {every['equations']} | {every['wrong']} |"]


def mutants(count: int) -> list[str]:
    found: dict[str, list[Mutant]] = {}
    every = [form for case in MUTATED for form in forms_of(*case)]
    for language in LANGUAGES:
        of = [form for form in every if form.name.startswith(f"{language},")]
        found[language] = [*of_forms(of, count, 1)]
    formulas = [
        form
        for name in ("scara", "two_branch", "words")
        for form in formula_forms(regrouping_of(name))
    ]
    texts = [form for form in formulas if form.name.startswith(("text", "JSON", "Python", "C,"))]
    found["formulas of base parameters"] = [*of_forms(texts, count, 1)]
    for language, ending in (("Python", ".py"), ("C", ".c")):
        found[f"lines of {language}"] = [*of_files(ending, count, 1)]
        print(language, flush=True)
    rows = []
    for printer, made in found.items():
        kinds = Counter(m.kind for m in made)
        refused = [m for m in made if m.refused]
        for m in made:
            if not m.refused:
                print(f"{printer}: {m.kind}: {m.label}: {m.right} -> {m.wrong}", flush=True)
        told = ", ".join(f"{kind} {n}" for kind, n in sorted(kinds.items()))
        rows.append(f"| {printer} | {len(made)} | {len(refused)} | {told} |")
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=200)
    parser.add_argument("--robots", nargs="*", default=list(ROBOTS))
    asked = parser.parse_args()
    lines = HEAD.format(robots=len(asked.robots), others=len(OTHERS)) + "\n".join(
        equations(asked.robots)
    )
    TABLE.write_text(lines + "\n" + MUTANTS + "\n".join(mutants(asked.mutants)) + "\n", "utf-8")


if __name__ == "__main__":
    main()
