"""The command line of symgen, with one module for each command."""
