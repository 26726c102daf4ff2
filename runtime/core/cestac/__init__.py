"""Study of the encoder resolution by the CESTAC method, eqs. (15) to (22), (28)."""
