"""Texts of files: studies and estimates read and written, YAML, within limits."""
