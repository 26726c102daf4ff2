"""Y = W X + rho, eqs. (6) and (14), and its triangular factor."""
