"""Least squares with its statistics, eqs. (7) to (11), weights by joint."""
