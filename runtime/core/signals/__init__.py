"""Filters from measured positions to q, qd, qdd without phase shift, and decimation (chapter 2.2.2)."""
