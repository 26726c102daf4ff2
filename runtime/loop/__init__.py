"""Simulation of the closed loop that moves the arm, and the methods that use it (IV, DIDIM)."""
