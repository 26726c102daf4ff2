"""How long a test waits for something before it says that it hangs."""

HANG = 600.0  # s on the clock; a guard against what never comes, not a measure of speed
