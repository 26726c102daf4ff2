"""Filters without phase shift, which compute q, qd, qdd from measured positions (chapter 2.2.2)."""
