"""Is the record, the robot file or the study wrong? What is asked before the fit and after it, and
the causes that are tried if something is.
"""
