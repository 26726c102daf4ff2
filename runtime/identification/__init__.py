"""One call from records to parameters, and how far to trust them."""
