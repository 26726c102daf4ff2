"""Certificates: checks of regrouping formulas and emitted code, and import of checked modules."""
