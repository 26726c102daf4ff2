"""An emitted module at the border: loaded, checked, compiled; its drives, inertial parameters and
what is mounted on it.
"""
