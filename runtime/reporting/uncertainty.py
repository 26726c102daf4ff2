"""Section of a report on how far an identification can be trusted."""

from __future__ import annotations

from collections.abc import Sequence

from runtime.identification.uncertainty import Trust
from runtime.reporting.page import Section, Table


def trust_section(trust: Trust) -> Section:
    """Deviations three ways, whiteness, F-tests along the trail, sets by threshold."""
    tables = [
        _table("Deviations: eq. (10), corrected for correlation, blocks of time drawn again", trust.scatter_lines()),
        _table("Residuals by joint: correlation of neighbours, Ljung-Box, rows that count, spectrum", trust.whiteness_lines()),
        _table("F-tests along the trail; rows that count instead of rows", trust.test_lines()),
        _table("Essential parameters by threshold; - removed besides, + kept besides", trust.set_lines()),
    ]
    return Section("How far to trust it", trust.verdict, tables=tables)


def _table(caption: str, lines: Sequence[Sequence[str]]) -> Table:
    return Table(caption, lines[0], lines[1:])
