"""The tables of limits: what a table holds its folder uses, what a folder uses its table holds, and each says what it means."""

import re
from pathlib import Path

import pytest

from runtime.ground.limits import LIMIT, entries, limits

ROOM = Path(__file__).parents[2] / "runtime"
FOLDERS = sorted(path.parent.name for path in ROOM.glob("*/limits.toml"))


def used(folder):
    text = "\n".join(p.read_text(encoding="utf-8") for p in folder.rglob("*.py"))
    return set(re.findall(r"LIMIT\.([A-Z]\w*)", text))


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_limit_is_used_and_described(folder):
    own = entries(f"runtime.{folder}")
    assert set(own) <= used(ROOM if folder == "ground" else ROOM / folder)
    assert used(ROOM / folder) <= {*own, *entries("runtime.ground")}
    for name, limit in own.items():
        assert set(limit) == {"value", "unit", "meaning", "measured"}, name
        assert limit["meaning"] and getattr(limits(f"runtime.{folder}"), name) == limit["value"]
        where = limit["measured"]
        assert not where or (ROOM.parent / where).is_file(), name


def test_no_name_stands_in_two_tables():
    names = [name for folder in FOLDERS for name in entries(f"runtime.{folder}")]
    assert len(names) == len(set(names))
    with pytest.raises(AttributeError, match="NOTHING"):
        _ = LIMIT.NOTHING
