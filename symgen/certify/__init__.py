"""Certificates: formulas by identities over F_p, every text that leaves by independent dynamics, and the modules that hold one, imported from a cache."""
