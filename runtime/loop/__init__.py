"""References, control laws, and the simulated closed loop that moves the arm."""
