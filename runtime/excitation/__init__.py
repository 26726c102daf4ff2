"""Search for the motion that determines the parameters most precisely.

Reference: chapter, section 2.2.3.
"""
