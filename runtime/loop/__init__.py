"""What moves the arm: references, control laws, and the simulated closed loop."""
