"""Parallel runs of a study in processes or on a cluster, and their storage on disk."""
