"""The uncertainty of an identification, as a section of a report."""

from __future__ import annotations

from collections.abc import Sequence

from runtime.identification.uncertainty import Uncertainty
from runtime.reporting.page import Section
from runtime.table import Table


def uncertainty_section(uncertainty: Uncertainty) -> Section:
    """Deviations three ways, whiteness, F-tests along the trail, sets by threshold."""
    tables = [
        _table(
            "Deviations: eq. (10), corrected for correlation, blocks of time drawn again",
            uncertainty.bootstrap_lines(),
        ),
        _table(
            "Residuals by joint: correlation of neighbours, Ljung-Box, rows that count, spectrum",
            uncertainty.whiteness_lines(),
        ),
        _table(
            "F-tests along the trail; rows that count instead of rows", uncertainty.test_lines()
        ),
        _table(
            "Essential parameters by threshold; - removed besides, + kept besides",
            uncertainty.set_lines(),
        ),
    ]
    return Section("How far to trust it", uncertainty.verdict, tables=tables)


def _table(caption: str, lines: Sequence[Sequence[str]]) -> Table:
    return Table(caption, lines[0], lines[1:])
