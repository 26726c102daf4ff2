"""Rows of a record that repeat the last packet of a slower bus, or of a controller that held it."""
