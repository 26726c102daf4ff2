"""Runs of a study in processes or on a cluster, and where they lie on disk."""
