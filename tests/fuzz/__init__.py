"""Hostile and broken input: whatever a file holds, reading it gives a result or a clear error, soon
and in little memory.

    cd tests && python -m fuzz --cases 20000 --seed 7             every format, shares as in FORMATS
    cd tests && python -m fuzz robot npz --cases 5000              some of them

seeds.py holds sound files; mutations.py, texts.py, xml_texts.py and archives.py change them, by
format in making.py; reading.py says what reading one means, harness.py does it in a process that
may die; corpus/ keeps every case that once failed, and test_fuzz.py replays it. A case is told by
format, seed and number alone.
"""
