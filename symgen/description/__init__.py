"""Read robot descriptions (robot files, SYMORO .par, URDF, MJCF) into immutable Robot objects."""

from symgen.description.angles import AngleWarning
from symgen.description.expression import Expression
from symgen.description.files import load_robot, packaged_robots, read_robot
from symgen.description.grammar import parse
from symgen.description.par import read_par
from symgen.description.robot import Drives, Element, Frame, Loop, Robot
from symgen.description.yaml import json_schema, parse_robot, skeleton, write_yaml

__all__ = [
    "AngleWarning",
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
    "read_par",
    "read_robot",
    "skeleton",
    "write_yaml",
]
