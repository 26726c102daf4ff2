"""Measured positions to q, qd, qdd, without phase: median, low-pass, differences, decimation (chapter 2.2.2)."""
