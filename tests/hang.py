"""How long a test waits for something before it says that it hangs."""

HANG = 40.0
