"""From a `Record` to the rows of Y = W X + rho, eqs. (6) and (14), and their triangular factor."""
