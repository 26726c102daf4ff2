"""Least squares, ordinary or weighted by joint, with its statistics, eqs. (7) to (11)."""
