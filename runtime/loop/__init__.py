"""Simulation of controller and arm in closed loop, and methods that use it (IV, DIDIM)."""
