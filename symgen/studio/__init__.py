"""A local web page for the whole work: robot, record, check, identification and results.

Every button of the page runs one `symgen` command in a work folder of ordinary files.
"""
