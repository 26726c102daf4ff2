"""Friction laws with fitted scalars, or with a column that depends on the transmitted torque."""
