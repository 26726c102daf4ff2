"""Octave for tests of MATLAB texts: where there is none, they are skipped, and the summary says so."""

from __future__ import annotations

import os

import pytest

from symgen.certify.call_octave import octave


def has_octave() -> bool:
    """Whether Octave is on this machine; an error where SYMGEN_REQUIRE_OCTAVE is set and it is not."""
    found = octave() is not None
    if not found and os.environ.get("SYMGEN_REQUIRE_OCTAVE"):
        raise RuntimeError("SYMGEN_REQUIRE_OCTAVE is set, but there is no octave on PATH")
    return found


needs_octave = pytest.mark.skipif(not has_octave(), reason="no Octave")
