"""The two demonstrations of the chapter, beside its published tables."""
