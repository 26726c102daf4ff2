"""Hostile and broken input: whatever a file holds, reading it gives a result or a clear error, soon and in little memory.

    cd tests && python -m fuzz --cases 20000 --seed 7             every format, shares as in FORMATS
    cd tests && python -m fuzz yaml npz --cases 5000              some of them

mutations.py, texts.py, archives.py make cases, formats.py says what reading one means, harness.py runs them in a process that may die; corpus/ keeps every
case that once failed, and test_fuzz.py replays it. A case is told by format, seed and number alone.
"""
