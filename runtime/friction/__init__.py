"""Friction of each joint against its velocity, and the friction law that describes it."""
