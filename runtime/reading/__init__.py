"""From the files of a measurement to Records: formats, columns, units, the clock, public data sets."""
