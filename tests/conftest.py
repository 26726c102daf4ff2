"""Puts tests/ on the import path (`from oracles... import ...`) and makes hypothesis reproducible."""

from hypothesis import settings

settings.register_profile("symgen", derandomize=True, deadline=None)
settings.load_profile("symgen")
