"""Laws of the columns that a robot file adds to W: fitted scalars, and dependence on a torque.

For instance the velocity of a Stribeck law is fitted, or friction depends on the transmitted
torque.
"""
