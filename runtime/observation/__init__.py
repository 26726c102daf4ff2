"""From a `Record` to the observed linear system Y = W X + rho, eqs. (6) and (14)."""
