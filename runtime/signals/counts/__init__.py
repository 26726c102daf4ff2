"""Positions read as counts of encoders: lattice, spline, sites, lines, reading."""
