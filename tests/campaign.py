"""Campaigns: checks over hundreds of cases. The default run takes a seeded sample of each; `pytest
-m campaign` runs the rest.

Of simulations and forgeries by the hundred a campaign runs a fixed sample. SYMGEN_FULL=1 runs every
case and multiplies what is drawn anew (fuzz cases, seeds): `benchmarks/every_case.py` does, and keeps
the table. CONTRIBUTING.md says what each costs.
"""

from __future__ import annotations

import os
import random
from collections.abc import Iterable
from typing import Any

import pytest

some = pytest.mark.some
"""`@some(count)`: so many cases of a parametrized test, drawn with a fixed seed, run by default."""
FULL = os.environ.get("SYMGEN_FULL") == "1"
campaign = pytest.mark.campaign


def sampled(
    cases: Iterable[Any], count: int, *, always: Iterable[Any] = (), more: int | None = None
) -> list[Any]:
    """Parameters of a test: `count` cases drawn with a fixed seed, and those of `always`, run by
    default; the others are a campaign.

    more : how many others are one; all of them where left out, or with SYMGEN_FULL=1.
    """
    listed = list(cases)
    kept = {
        *random.Random(0).sample(range(len(listed)), count),
        *(listed.index(case) for case in always),
    }
    others = [k for k in range(len(listed)) if k not in kept]
    if more is not None and not FULL:
        others = random.Random(1).sample(others, more)
    return [
        case if k in kept else pytest.param(case, marks=campaign)
        for k, case in enumerate(listed)
        if k in {*kept, *others}
    ]
