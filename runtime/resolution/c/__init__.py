"""The kernels of resolution studies in C, checked against NumPy before they are used."""
