"""The table of limits: what it holds is used, what is used it holds, and each says what it means."""

import re
from pathlib import Path

import pytest

from runtime.core.limits import ENTRIES, LIMIT

ROOM = Path(__file__).parents[2] / "runtime"


def test_every_limit_is_used_and_described():
    text = "\n".join(p.read_text(encoding="utf-8") for p in ROOM.rglob("*.py"))
    used = set(re.findall(r"LIMIT\.([A-Z]\w*)", text))
    assert used == set(ENTRIES)
    for name, limit in ENTRIES.items():
        assert set(limit) == {"value", "unit", "meaning", "measured"}, name
        assert limit["meaning"] and getattr(LIMIT, name) == limit["value"]
        where = limit["measured"]
        assert not where or (ROOM.parent / where).is_file(), name
    with pytest.raises(AttributeError, match="NOTHING"):
        _ = LIMIT.NOTHING
