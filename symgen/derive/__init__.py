"""Mechanics, written once over scalars: geometry, recursions, loops.

Lagrange by CasADi as an independent check.
"""
