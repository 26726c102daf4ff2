"""Derivation of the robot models as formulas: geometry, recursions and closed loops."""
