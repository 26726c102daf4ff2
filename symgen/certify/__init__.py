"""Certificates: checks of regrouping formulas and emitted code, and import of checked modules.

The module `lagrange` derives the dynamics a second time, from the energies with CasADi.
"""
