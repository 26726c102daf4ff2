"""Derivation of the robot models as formulas: geometry, recursions and closed loops.

The module `lagrange` derives the dynamics a second time, from the energies with CasADi. It is an
independent check.
"""
