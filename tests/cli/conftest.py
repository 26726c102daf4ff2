"""Figures of the verbs are drawn with panels where they happen to stand: tests/report looks at them as they are printed."""

import pytest


@pytest.fixture(autouse=True, scope="session")
def no_search_for_places():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("runtime.reporting.figures.LAYOUT", None)
        yield
