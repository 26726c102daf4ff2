"""Identified values back into the URDF or MJCF file that a robot was read from."""
