"""Every case of the tests of which a campaign runs some: `python benchmarks/every_case.py [WORD ...]
[--cases N]`.

Runs the tests of TESTS (those whose name holds a WORD) with SYMGEN_FULL=1 and writes their rows of
every_case.md; the other rows stay. With --cases N at most N cases of each, drawn with a fixed seed.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import resource
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from datetime import date
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
TABLE = Path(__file__).with_suffix(".md")
TESTS = {
    "certify/test_certificate.py::test_random_robots_exactly_and_numerically": "a random robot: rank and coefficients against CasADi",
    "certify/test_certificate.py::test_every_flipped_coefficient_of_the_random_robots_is_caught": "a random robot: each coefficient with the other sign is refused",
    "certify/test_claim.py::test_a_false_claim_is_refused": "a forged claim of a robot is refused by the checker that needs no symgen",
    "certify/test_text_faults.py::test_faults_are_refused": "50 faults in emitted texts are refused",
    "regroup/test_numbers.py::test_many_random_robots_with_numbers": "20 robots with numbers: certified, and each perturbed coefficient refused",
    "emit/test_namespace.py::test_a_word_as_a_constant_is_kept_or_refused": "a word of Python, C, NumPy or the layout as the name of a constant",
    "emit/test_namespace.py::test_a_family_is_kept_or_refused": "a family of elements named by up to three letters",
    "emit/test_c_loops.py::test_random_mechanisms": "a random loop: every function of the C file",
    "oracles/test_emitted_agree.py::test_module_against_oracle": "a robot: its module against Lagrange or pinocchio",
    "oracles/test_on_request.py::test_dynamics_on_request": "a robot: functions on request against pinocchio",
    "oracles/test_loops_agree.py::test_module_against_multipliers": "a parallelogram or packaged loop against Lagrange multipliers",
    "oracles/test_loops_agree.py::test_certificate": "the same: its certificate",
    "oracles/test_loops_agree.py::test_never_an_antiparallelogram": "the same: opposite sides stay parallel",
    "oracles/test_random_loops.py::test_more_of_each_kind": "8 loops of a kind against Lagrange multipliers",
    "oracles/test_turned_loops.py::test_more_behind_turning_joints": "8 loops of a kind behind one to three hinges",
    "oracles/test_turned_loops.py::test_coefficients_of_no_moderate_degree": "a loop behind hinges whose coefficients are read at the numbers of its file",
    "symbols/test_random_robots.py::test_random_robot": "a random robot: every symbolic model against Lagrange",
    "symbols/test_printed_back.py::test_every_model_holds_in_every_form_and_format": "a model of a robot, read back from every format",
    "core/test_simulated_tx40.py::test_stated_sigma_is_the_scatter_over_records": "40 or 200 simulated records: stated deviations against their scatter",
    "plausible/test_delay.py::test_two_deviations_hold_95_percent": "50 simulated records with a delay: how often two deviations hold it",
    "plausible/test_plausibility.py::test_a_slip_of_the_palletiser_is_named": "a slip of the palletiser is named",
    "plausible/test_plausibility.py::test_slips_of_the_kr300_are_named": "a slip of the measured KR300 is named",
    "plausible/test_plausibility.py::test_right_studies_of_random_robots_are_left_alone": "a right study of a random robot is told no cause",
    "plausible/test_truth_benchmark.py::test_slips_of_strangers_are_named": "a slip of a wrist or a Panda is named",
    "cli/test_long_record.py::test_an_hour_of_seven_joints_takes_less_than_4_gb": "an hour of seven joints at 1 kHz",
}
ROW = re.compile(r"^\| (?P<what>.*?) \| `(?P<test>.*?)` \|.*$", re.MULTILINE)
HEAD = """# Every case of what the campaigns sample: figures

`.ci/run` runs a fixed sample of each of these tests; `python benchmarks/every_case.py` runs every case, with the same assertions, and writes this table.
"Run" says how many of all cases the row is of. Processor time includes the start of two test processes.

| a case | test, in `tests/` | cases | run | passed | processor time, s | date |
|---|---|---|---|---|---|---|
"""


def pytest(*arguments: str) -> str:
    command = [sys.executable, "-m", "pytest", "-m", "", "-p", "no:cacheprovider", *arguments]
    environment = os.environ | {"SYMGEN_FULL": "1"}
    return subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    ).stdout


def cases(test: str) -> list[str]:
    """Names of all cases of a test."""
    told = pytest(f"tests/{test}", "-n", "0", "--collect-only", "-o", "addopts=", "-q")
    return [line for line in told.splitlines() if "::" in line]


def spent() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def row(test: str, most: int | None) -> str:
    every = cases(test)
    chosen = every if most is None else random.Random(0).sample(every, min(most, len(every)))
    with TemporaryDirectory() as folder:
        before, report = spent(), Path(folder) / "report.xml"
        said = pytest(f"--junit-xml={report}", *chosen)
        seconds = spent() - before
        results = list(ElementTree.parse(report).iter("testcase"))
    passed = sum(not len(result) for result in results)
    if passed < len(results):
        print(said, flush=True)
    return (
        f"| {TESTS[test]} | `{test}` | {len(every)} | {len(results)} | {passed} | "
        f"{seconds:.0f} | {date.today():%-d %B %Y} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--cases", type=int)
    asked = parser.parse_args()
    text = TABLE.read_text(encoding="utf-8") if TABLE.exists() else ""
    rows = {found["test"]: found[0] for found in ROW.finditer(text) if found["test"] in TESTS}
    for test in TESTS:
        if not asked.words or any(word in test for word in asked.words):
            rows[test] = row(test, asked.cases)
            print(rows[test], flush=True)
            TABLE.write_text(HEAD + "\n".join(rows[t] for t in TESTS if t in rows) + "\n", "utf-8")


if __name__ == "__main__":
    main()
