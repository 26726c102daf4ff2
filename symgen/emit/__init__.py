"""Code generator: writes the models of a robot over its base parameters in Python and C."""
