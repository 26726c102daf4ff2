"""One self-contained HTML page of a robot: drawing, frame table, formulas, parameter effects."""
