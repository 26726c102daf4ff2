"""The page where one works: a local server whose every button is one command of `symgen` in a work
folder of ordinary files.
"""
