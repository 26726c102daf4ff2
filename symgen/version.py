"""The version, part of the header of every emitted module."""

VERSION = "0.4.0"
