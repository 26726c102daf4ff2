"""The version of symgen, which the header of every emitted module contains."""

VERSION = "0.5.0"
