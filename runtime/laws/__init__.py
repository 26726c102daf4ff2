"""Laws of columns: their scalars fitted, the torque that a joint transmits."""
