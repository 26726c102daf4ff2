"""Emission: from base parameters to the text of modules in every target."""
