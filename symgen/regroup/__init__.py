"""Base parameters with exact formulas, the formulas in every language they are printed in, and their certificate."""
