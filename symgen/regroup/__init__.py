"""Base parameters with exact formulas, and their certificate."""
