"""Is the record, the robot file or the study wrong? Checks before and after the fit, each with a
name, a number and a remedy.
"""
