"""Base parameters of a robot and their exact regrouping formulas."""
