"""Base parameters with exact formulas, and the formulas in every language they are printed in."""
