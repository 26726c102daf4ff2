"""Conditions that the parameters of a physical robot meet, and the nearest values that do."""
