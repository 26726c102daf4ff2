"""The regressor of a model in C: the C file that was emitted, compiled on first use."""
