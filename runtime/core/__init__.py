"""Core of the identification: records, observation matrix, least squares, CESTAC."""
