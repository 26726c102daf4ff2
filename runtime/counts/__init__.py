"""Encoder counts read as counts."""
