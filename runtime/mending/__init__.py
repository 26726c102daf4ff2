"""Find several errors of a study at once, and write the study in which they are mended.

A set of changes of the study, or of its section `robot`, is searched on some blocks of the records
and judged on the other blocks, which neither search nor fit has used. All changes are kept, or
none.
"""
