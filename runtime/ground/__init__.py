"""What every room stands on: errors, settings, limits, arrays, tables, JSON, parts of a report."""
