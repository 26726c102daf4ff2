"""A study file as checked values: what an experiment is, apart from the robot and the measured
numbers.
"""
