"""Basis of all other folders of `runtime`: errors, settings, limits, arrays, tables, JSON, parts of
a report.
"""
