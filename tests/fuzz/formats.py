"""What is fuzzed: per format how a case is made and what reading one means."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from fuzz import archives, making, reading


@dataclass(frozen=True)
class Format:
    """ending : of the file.   make : a case of a random generator.   read : the bytes, as the file called `case.ENDING` in an empty folder.

    share : of the cases of all formats.   named : texts of which an error holds one: the file, as the user knows it.
    foreign : whether a compiled library reads it: that it hangs or dies on damage is nothing that Python could turn into a message (docs/many_runs.md).
    """

    ending: str
    make: Callable[[random.Random], bytes]
    read: Callable[[Path], object]
    share: int
    named: tuple[str, ...] = ("case",)
    foreign: bool = False


FAULTY = Format("txt", lambda rng: b"ok", reading.read_faulty, 0)

FORMATS: dict[str, Format] = {
    "robot": Format("yaml", making.make_robot, reading.read_robot, 200),
    "expression": Format("yaml", making.make_expression, reading.read_robot, 90),
    "derived": Format("yaml", making.make_derived, reading.read_and_derive, 20, ("case.", "robot")),
    "par": Format("par", making.make_par, reading.read_robot, 100),
    "urdf": Format("urdf", making.make_urdf, reading.read_robot, 100),
    "mjcf": Format("xml", making.make_mjcf, reading.read_robot, 70),
    "study": Format("yaml", making.make_study, reading.read_study, 100),
    "motion": Format("yaml", making.make_motion, reading.read_motion, 20, ("case", "reference")),
    "csv": Format("csv", making.make_csv, reading.read_record, 70),
    "csv.gz": Format("csv.gz", making.make_csv_gz, reading.read_record, 20),
    "npz": Format("npz", making.make_npz, reading.read_record, 60),
    "npy": Format("npy", archives.npy, reading.read_record, 30),
    "mat": Format("mat", making.make_mat, reading.read_record, 50, foreign=True),
    "mat73": Format("mat", making.make_mat73, reading.read_record, 30, foreign=True),
    "parquet": Format("parquet", making.make_parquet, reading.read_record, 8, foreign=True),
    "bag": Format("bag", partial(making.make_bag, "bag"), reading.read_record, 20, foreign=True),
    "mcap": Format("mcap", partial(making.make_bag, "mcap"), reading.read_record, 20, foreign=True),
    "db3": Format("db3", partial(making.make_bag, "db3"), reading.read_record, 15, foreign=True),
    "ros2": Format(
        "zip", making.make_ros2, reading.read_folder, 20, ("case", "run."), foreign=True
    ),
    "model": Format("py", making.make_model, reading.read_model, 20),
    "checkpoint": Format(
        "npz", making.make_checkpoint, reading.read_checkpoint, 10, ("000000.npz",)
    ),
    "settings": Format(
        "json", making.make_settings, reading.read_settings, 5, ("study.json", "runs")
    ),
    "estimate": Format("json", making.make_estimate, reading.read_estimate, 15),
}
