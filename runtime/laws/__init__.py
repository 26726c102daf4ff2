"""Functions (laws) that add columns to W, such as a Stribeck law: fit of their constants.

A law may depend on the torque that its joint transmits, as load-dependent friction does.
"""
