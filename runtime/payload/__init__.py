"""Parameters of a load fixed to a link, and torque constants of the drives from a weighed load."""
