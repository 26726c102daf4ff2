"""The linear system Y = W X + rho, eqs. (6) and (14), its rows and its triangular factor."""
