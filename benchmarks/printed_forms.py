"""Every printed equation against the graph, and mutants of every printer that the reader refuses.

    python benchmarks/printed_forms.py [--mutants 200] [--robots NAME ...] [--printers NAME ...]      writes benchmarks/printed_forms.md

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
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "support")]

from forms.mutants import Mutant, of_files, of_forms
from forms.printed import Form, formula_forms
from forms.test_forms import LANGUAGES, OTHERS, ROBOTS, forms_of, regrouping_of

from symgen.certify.texts import TextCheck, text_check
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
        start, seen = time.process_time(), Counter()
        for name, form in forms_of_robot(robot):
            wrong = form.wrong()
            seen[name] += len(form.equations)
            total.setdefault(name, Counter()).update(
                equations=len(form.equations), wrong=len(wrong)
            )
            if wrong:
                print(f"{robot}: {name}: {wrong[:5]}", flush=True)
        for name, text_checked in run(robot):
            seen[name] += len(text_checked.errors)
            total.setdefault(name, Counter()).update(
                equations=len(text_checked.errors), wrong=len(text_checked.wrong)
            )
            if text_checked.wrong:
                print(f"{robot}: {name}: {text_checked.wrong}", flush=True)
        for name in +seen:
            total[name]["robots"] += 1
        print(f"{robot}: {time.process_time() - start:.0f} s", flush=True)
    every = sum(total.values(), Counter())
    total = dict(sorted(total.items())) | {"all": every | Counter(robots=len(robots))}
    total["all"]["robots"] = len(robots)
    return [f"| {n} | {x['robots']} | {x['equations']} | {x['wrong']} |" for n, x in total.items()]


def forms_of_robot(robot: str) -> Iterator[tuple[str, Form]]:
    for form in formula_forms(regrouping_of(robot)):
        yield f"formulas, {form.name}", form
    for model in SYMBOLIC:
        for form in forms_of(robot, model):
            yield form.name, form


def run(robot: str) -> Iterator[tuple[str, TextCheck]]:
    regrouping = regrouping_of(robot)
    witness = Witness(regrouping)
    files = generate_files(regrouping.robot, targets=tuple(LANGUAGE), regrouping=regrouping)
    for file, text in files.items():
        target = "c" if file.endswith(".c") else "numpy"
        if not file.endswith(".h"):
            yield f"functions of {LANGUAGE[target]}", text_check(file, text, target, witness)


LANGUAGE = {"numpy": "Python", "c": "C"}


def mutants(count: int, printers: list[str]) -> list[str]:
    rows = []
    for printer in printers:
        made = [*mutants_of(printer, count)]
        for m in made:
            if not m.refused:
                print(f"{printer}: {m.kind}: {m.label}: {m.right} -> {m.wrong}", flush=True)
        kinds = Counter(m.kind for m in made)
        told = ", ".join(f"{kind} {n}" for kind, n in sorted(kinds.items()))
        rows.append(f"| {printer} | {len(made)} | {sum(m.refused for m in made)} | {told} |")
        print(rows[-1], flush=True)
    return rows


def mutants_of(printer: str, count: int) -> Iterator[Mutant]:
    if printer.startswith("lines of"):
        return of_files({"Python": ".py", "C": ".c"}[printer.rsplit(maxsplit=1)[-1]], count, 1)
    if printer == FORMULAS:
        robots = map(regrouping_of, ("scara", "two_branch", "words"))
        found = [form for robot in robots for form in formula_forms(robot)]
        return of_forms(
            [form for form in found if not form.name.startswith(("LaTeX", "MathML"))], count, 1
        )
    found = [form for case in MUTATED for form in forms_of(*case)]
    return of_forms([f for f in found if f.name.startswith(f"{printer},")], count, 1)


FORMULAS = "formulas of base parameters"
PRINTERS = [*LANGUAGES, FORMULAS, "lines of Python", "lines of C"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=200)
    parser.add_argument("--robots", nargs="*", default=list(ROBOTS))
    parser.add_argument("--printers", nargs="*", default=PRINTERS)
    asked = parser.parse_args()
    found = equations(asked.robots) if asked.robots else ["| not run | | | |"]
    rows = mutants(asked.mutants, asked.printers)
    head = HEAD.format(robots=len(asked.robots), others=len(OTHERS))
    TABLE.write_text(head + "\n".join(found) + "\n" + MUTANTS + "\n".join(rows) + "\n", "utf-8")


if __name__ == "__main__":
    main()
