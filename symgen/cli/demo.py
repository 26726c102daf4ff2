"""`symgen demo`: the main job end to end."""

from symgen.demo.tx40 import demo

__all__ = ["demo"]
