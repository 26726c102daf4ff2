"""What a user writes: robot files, read into the frozen Robot."""

from symgen.description.expression import Expression
from symgen.description.grammar import parse
from symgen.description.new import skeleton
from symgen.description.robot import Drives, Element, Frame, Loop, Robot
from symgen.description.schema import json_schema
from symgen.description.yaml import load_robot, packaged_robots, parse_robot

__all__ = [
    "Drives",
    "Element",
    "Expression",
    "Frame",
    "Loop",
    "Robot",
    "json_schema",
    "load_robot",
    "packaged_robots",
    "parse",
    "parse_robot",
    "skeleton",
]
