"""A question about a record, a study or a result, with its answer, its limit and its remedy."""
