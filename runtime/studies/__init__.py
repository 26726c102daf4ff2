"""Studies that need one optional library each."""
