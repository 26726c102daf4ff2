"""A load fixed to a link, and the torque constants of the drives from it."""
