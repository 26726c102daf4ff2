"""Code generator: writes the models of a robot, in terms of base parameters, in Python and C."""
