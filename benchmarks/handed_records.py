"""The words of the verdict on measured records beside the error on records that no fit has seen.

    SYMGEN_DATA=... python benchmarks/handed_records.py

Robots, splits and treatment are those of the comparison (`benchmarks/tools/records.py`); the study is
the default one. Each case is a line of handed_records.md.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parent / "tools"))

import records as measured
from truth_shared import markdown

import runtime
import symgen
from runtime.core.validation import prediction_errors
from runtime.study import study_from_mapping

CASES = (measured.tx40, measured.emps, measured.kr300, measured.go2)


def line(case: measured.Case) -> tuple[str, ...]:
    """Verdict of what is fitted, its expected error, and the error on what is predicted."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"{case.name}.{case.suffix}"
        file.write_text(case.robot, encoding="utf-8")
        model, variants = symgen.model(file), symgen.variants(file)
    fitted, unseen = (
        [runtime.Record(p.t, p.q, p.tau, name=f"{k}") for k, p in enumerate(pieces)]
        for pieces in (case.train, case.test)
    )
    study = study_from_mapping({})
    result = runtime.identify(model, fitted, study, variants=variants)
    expected = result.part("expected_error").expected
    error = prediction_errors(runtime.observe(model, unseen, result.study), result.model_estimate)[
        0
    ]
    doubt = result.checklist.worst
    return (
        case.name,
        result.checklist.answer,
        f"{result.model_estimate.relative_error:.1f}",
        f"{expected.error:.2g} ({expected.low:.2g} to {expected.high:.2g})",
        f"{error:.1f}",
        "none" if doubt is None else doubt.question,
        doubt.finding if doubt else "",
    )


def main() -> None:
    head = (
        "record", "verdict", "unexplained, %", "expected error, %", "error on unseen record, %",
        "largest doubt", "finding",
    )  # fmt: skip
    lines = []
    for case in CASES:
        lines.append(line(case()))
        print(lines[-1], flush=True)
    print(markdown(head, lines))


if __name__ == "__main__":
    main()
