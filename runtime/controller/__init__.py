"""The law of a controller as the torque of a record that has none."""
