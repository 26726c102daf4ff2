"""Fixtures of the tests of pages."""

import pytest
from browser import started_browser


@pytest.fixture(scope="module")
def browser():
    with started_browser() as browser:
        yield browser
