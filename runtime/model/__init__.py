"""An emitted module at the border: found, checked, compiled; its drives and what is mounted on it."""
