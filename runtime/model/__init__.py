"""An emitted module at the border: loaded and checked; its drives, inertial parameters and
what is mounted on it.
"""
