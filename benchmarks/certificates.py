"""Claims of `symgen check --certificate`, true and forged, as docs/examples/check_certificate.py judges them.

    python benchmarks/certificates.py         writes benchmarks/certificates.md

The claims are those of tests/certify/forgeries.py; tests/certify/test_claim.py runs a sample. Exit
codes are 0 verified, 1 refuted, 2 not judged.
"""

# ruff: noqa: E402
from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from certify.forgeries import edited, packaged, true_claims, with_dependent_laws

from symgen.description import packaged_robots

SCRIPT = ROOT / "docs" / "examples" / "check_certificate.py"
GENERAL_LOOPS = ("four_bar", "five_bar")
TABLE = ROOT / "benchmarks" / "certificates.md"
HEAD = """# Certificates that others check

`python benchmarks/certificates.py` writes this table: claims of `tests/certify/forgeries.py`, judged by `docs/examples/check_certificate.py`.
Exit codes are 0 verified, 1 refuted, 2 not judged; a forged claim with 0 would be a hole.

| claims | number | 0 | 1 | 2 | not as expected |
|---|---|---|---|---|---|
"""


def code(text: str, folder: Path) -> tuple[int, str]:
    path = folder / "claim.json"
    path.write_text(text, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-I", str(SCRIPT), str(path)], capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout.strip() or done.stderr.strip()


def row(what: str, claims: list[tuple[str, str, set[int]]], folder: Path) -> str:
    count: Counter[int] = Counter()
    wrong = []
    for name, text, right in claims:
        status, told = code(text, folder)
        count[status] += 1
        if status not in right:
            wrong.append(name)
            print(f"{what}: {name}: {status}, {told}", flush=True)
    return (
        f"| {what} | {len(claims)} | {count[0]} | {count[1]} | {count[2]} | "
        f"{'; '.join(f'`{name}`' for name in wrong) or 'none'} |"
    )


def main() -> None:
    groups = {
        "packaged robots": [(name, packaged(name), {0}) for name in packaged_robots()],
        "true, with columns that are judged": [
            (name, text, {0}) for name, text, right in true_claims() if right == 0
        ],
        "true, with other columns": [
            (name, text, {2}) for name, text, right in true_claims() if right == 2
        ],
        "forged: dependent laws": [
            (name, json.dumps(claim), {1, 2}) for name, claim in with_dependent_laws()
        ],
        "forged: fields": [(name, json.dumps(claim), {1, 2}) for name, claim in edited(100, 1)],
        "forged: fields, a second seed": [
            (name, json.dumps(claim), {1, 2}) for name, claim in edited(100, 2)
        ],
        "forged: fields, joints that closure equations tie": [
            (name, json.dumps(claim), {1, 2}) for name, claim in edited(100, 3, GENERAL_LOOPS)
        ],
    }
    with TemporaryDirectory() as folder:
        rows = [row(what, claims, Path(folder)) for what, claims in groups.items()]
    TABLE.write_text(HEAD + "\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
