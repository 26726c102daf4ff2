"""Conversion of measurement files to Records: formats, columns, units, clock, public data sets."""
