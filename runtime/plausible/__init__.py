"""Check whether the record, the robot file or the study (its settings) is wrong.

Some checks are made before the fit, others after it. If one of them is doubtful, possible errors
(causes) are tried, for instance a wrong sign or unit.
"""
