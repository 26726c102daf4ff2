"""Conditions on the parameters of a physical robot, and the nearest parameters that fulfil them."""
