"""Reading records and data sets: one format per file."""
