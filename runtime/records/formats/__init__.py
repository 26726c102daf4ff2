"""One file format a module: named columns of numbers out of measured files."""
