"""From measured positions and torques to signals, by filters or by the counts of encoders."""
