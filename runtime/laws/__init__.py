"""Functions (laws) for columns that a robot file adds to W: constants to fit, torque dependence.

For instance the velocity of a Stribeck law is fitted, or friction depends on the transmitted
torque.
"""
