"""Parallel runs of a study in processes, and their storage on disk."""
