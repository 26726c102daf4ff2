"""What is fuzzed: per format the seeds, how a case is made, and what reading it means. Seeds are packaged robots and small records made at run time."""

from __future__ import annotations

import io
import json
import os
import random
import signal
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from fuzz import archives, texts
from fuzz.mutations import mutated

if TYPE_CHECKING:
    from runtime.study import Columns

ROBOTS = ("planar_2r", "emps_asymmetric", "scara", "two_branch", "emps", "stanford", "rx90", "four_bar", "sr400", "panda", "tx40")
ROWS = 12
COLUMNS = ("t", "q1", "q2", "tau1", "tau2")


@dataclass(frozen=True)
class Format:
    """ending : of the file.   make : a case of a random generator.   read : the bytes, as the file called `case.ENDING` in an empty folder.

    share : cases in a thousand.   named : texts of which an error holds one: the file, as the user knows it.
    """

    ending: str
    make: Callable[[random.Random], bytes]
    read: Callable[[Path], object]
    share: int
    named: tuple[str, ...] = ("case",)


# --- seeds ------------------------------------------------------------------------------------------------------------


def robot_file(name: str) -> bytes:
    """Bytes of a packaged robot."""
    return (resources.files("symgen.description") / "robots" / f"{name}.yaml").read_bytes()


@cache
def robots() -> tuple[bytes, ...]:
    return tuple(robot_file(name) for name in ROBOTS)


@cache
def robot_tables() -> tuple[dict, ...]:
    return tuple(texts.plain(content) for content in robots())


@cache
def par_files() -> tuple[bytes, ...]:
    from symgen.description import load_robot
    from symgen.description.par_write import write_par

    return tuple(write_par(load_robot(name))[0].encode() for name in ("planar_2r", "scara", "two_branch", "tx40_table1", "sr400"))


@cache
def urdf_files() -> tuple[bytes, ...]:
    from symgen.description import load_robot
    from symgen.description.urdf_write import write_urdf

    loaded = [load_robot(name) for name in ("planar_2r", "scara", "stanford", "rx90")]
    return tuple(write_urdf(replace(robot, values=dict.fromkeys(robot.parameters, 0.25)))[0].encode() for robot in loaded)


@cache
def record_columns() -> np.ndarray:
    """(ROWS, 5): t, q1, q2, tau1, tau2."""
    t = np.arange(ROWS) / 100
    return np.column_stack([t, np.sin(t), np.cos(t), t - 1, 2 * t])


@cache
def csv_file() -> bytes:
    return ("\n".join([",".join(COLUMNS), *(",".join(map(repr, map(float, row))) for row in record_columns())]) + "\n").encode()


@cache
def npz_members() -> dict[str, bytes]:
    return {f"{name}.npy": archives.plain_npy(record_columns()[:, k]) for k, name in enumerate(COLUMNS)}


@cache
def npz_file() -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **{name: record_columns()[:, k] for k, name in enumerate(COLUMNS)})
    return stream.getvalue()


@cache
def mat_files() -> tuple[bytes, ...]:
    from scipy.io import savemat

    found = []
    for settings in ({}, {"do_compression": True}, {"format": "4"}):
        stream = io.BytesIO()
        more = {} if settings.get("format") else {"s": {"a": 1.0, "b": ["x", "y"]}, "c": np.array([1, "x"], dtype=object), "flag": True}
        savemat(stream, {name: record_columns()[:, k] for k, name in enumerate(COLUMNS)} | more, **settings)
        found.append(stream.getvalue())
    return tuple(found)


@cache
def parquet_files() -> tuple[bytes, ...]:
    import polars

    frame = polars.DataFrame({name: record_columns()[:, k] for k, name in enumerate(COLUMNS)}).with_columns(
        x=polars.lit("text"), i=polars.lit(3)
    )
    found = []
    for compression in ("uncompressed", "snappy", "zstd", "gzip"):
        stream = io.BytesIO()
        frame.write_parquet(stream, compression=compression, row_group_size=5)
        found.append(stream.getvalue())
    return tuple(found)


@cache
def bag_files() -> dict[str, tuple[bytes, ...]]:
    """Bags of ROWS messages by the ending of their file, plain and compressed."""
    from numeric.bag_files import KINDS, joint_states, write_bag

    stamps = 1_700_000_000_000_000_000 + 10_000_000 * np.arange(ROWS)
    x = record_columns()
    topics = {"/joint_states": joint_states(stamps, ("a", "b"), x[:, 1:3], x[:, 3:])}
    found: dict[str, tuple[bytes, ...]] = {}
    for kind in KINDS:
        with TemporaryDirectory() as folder:
            path = write_bag(kind, Path(folder) / "run", topics)
            for file in [path] if path.is_file() else sorted(path.iterdir()):
                if (ending := file.suffix[1:]) in ("bag", "db3", "mcap"):
                    found[ending] = (*found.get(ending, ()), file.read_bytes())
    return found


@cache
def study_tables() -> tuple[dict, ...]:
    from runtime.io.datasets import dataset_study
    from runtime.study import Study, study_from_mapping, to_mapping

    small = {"symgen": 1, "record": {"files": ["a.csv"], "rate": 1000}, "cestac": {"delta": ["2*pi/10000"], "runs": 3}, "stream": "off"}
    rich = small | {
        "payload": {"record": {"files": ["b.csv"]}, "known": {"M": 2.0}, "gains": True},
        "controller": {
            "law": {"kind": "pid", "kp": [1.0, 2.0]},
            "rate": 500,
            "reference": {"points": {"duration": 10, "seed": 1}},
            "values": {"M1": 1},
        },
        "excitation": {"starts": 2, "spheres": [{"frame": 2, "radius": 0.1}], "limits": {"q": [[-1, 1], 2]}},
        "validate": {
            "split": [[0, 1], [1, 2]],
            "record": [{"files": ["c.csv"], "units": {"q": "deg", "tau": "A"}, "torque_constant": 0.1}],
        },
    }
    complete = to_mapping(study_from_mapping(dataset_study("tx40")))
    return (
        small,
        rich,
        dataset_study("tx40"),
        dataset_study("emps"),
        json.loads(json.dumps(complete)),
        json.loads(json.dumps(to_mapping(Study()))),
    )


FLEETS = ({"symgen": 1, "jobs": [{"robot": "tx40", "record": "tx40"}, {"name": "left", "robot": "a.yaml", "record": "b.csv"}]},)
MOTION = {
    "parts": [
        {"family": "fourier", "period": 10.0, "harmonics": 2, "p": [[0.1] * 5] * 2},
        {"family": "point-to-point", "points": 3, "p": [[0.0, 0.1, 0.2]] * 2},
    ]
}


@cache
def model_files() -> tuple[bytes, ...]:
    from symgen.description import load_robot
    from symgen.emit import generate_module

    return tuple(generate_module(load_robot(name)).encode() for name in ("planar_2r", "emps_asymmetric"))


def checkpoint_arrays() -> dict[str, np.ndarray]:
    return {
        "level": np.zeros(3, dtype=int),
        "run": np.arange(3),
        "X": np.ones((3, 2)),
        "residual_norm": np.ones(3),
        "normal": np.ones(3, dtype=bool),
    }


@cache
def estimate_file() -> bytes:
    from hashlib import sha256

    from runtime.estimators import estimate
    from runtime.model_text import ModelText  # a model from text, checked like any file
    from runtime.observation import observe, stack
    from runtime.record import Record
    from runtime.study import study_from_mapping
    from symgen.description import load_robot
    from symgen.emit import generate_module

    text = generate_module(load_robot("planar_2r"))
    model = ModelText("planar_2r.py", text, sha256(text.encode()).hexdigest()).load()
    rng, t = np.random.default_rng(1), np.arange(400) / 100
    record = Record(t, np.sin(t[:, None] * [1.0, 2.3]), rng.standard_normal((400, 2)), 100.0, "x")
    study = study_from_mapping({"signals": {"lowpass": None, "decimate": None}})
    return estimate(stack([observe(model, record, study)]), study.estimate, model=model).to_json().encode()


# --- making -----------------------------------------------------------------------------------------------------------


def either(
    rng: random.Random,
    seeds: tuple[bytes, ...],
    structured: Callable[[random.Random], bytes],
    share: float = 0.6,
    tokens: tuple[bytes, ...] | None = None,
) -> bytes:
    """A case that is aware of the structure, or any bytes changed, or both."""
    content = structured(rng) if rng.random() < share else rng.choice(seeds)
    if rng.random() < share and content not in seeds:
        return content
    return mutated(content, rng, seeds) if tokens is None or rng.random() < 0.5 else mutated(content, rng, seeds, tokens)


def small_first(rng: random.Random, items: tuple) -> object:
    """One of the items, the first ones more often."""
    return items[min(int(rng.expovariate(0.4)), len(items) - 1)]


def make_robot(rng: random.Random) -> bytes:
    return either(
        rng, robots(), lambda rng: texts.structured(small_first(rng, robot_tables()), rng, others=robot_tables()), tokens=texts.TOKENS
    )


def make_expression(rng: random.Random) -> bytes:
    table = small_first(rng, robot_tables()[:3])
    spots = [
        path
        for path in texts.places(table)
        if path and path[0] in ("frames", "gravity", "elements", "constants", "constraints", "limits", "drives", "values")
    ]
    for _ in range(rng.choice((1, 2, 4))):
        table = texts.changed(table, rng.choice(spots), texts.Raw("'" + texts.expression(rng, ("q1", "q2", "D2", "g"), 5) + "'"))
    return texts.yaml_text(table).encode()


def make_derived(rng: random.Random) -> bytes:
    """Files that still describe a robot more often: one number or expression changed."""
    table = small_first(rng, (robot_tables()[0], robot_tables()[4], robot_tables()[2], robot_tables()[3]))
    spots = [
        path
        for path in texts.places(table)
        if path and path[0] in ("frames", "gravity", "constants", "elements", "values", "drives", "limits", "title", "source", "name")
    ]
    value = rng.choice(
        (
            "0",
            "1e-60",
            "1e60",
            "123456789.123456789",
            "-1",
            "pi/7",
            "1e-30",
            "D2*1e30",
            "sqrt(2)",
            "sin(0.1)",
            "1/3",
            "q2",
            "-g",
            "g**3",
            "'x y'",
            "title",
            texts.expression(rng, ("q1", "D2", "g"), 3),
        )
    )
    return texts.yaml_text(texts.changed(table, rng.choice(spots), texts.Raw(value))).encode()


def make_study(rng: random.Random) -> bytes:
    seeds = tuple(texts.yaml_text(table).encode() for table in study_tables())
    return either(
        rng, seeds, lambda rng: texts.structured(rng.choice(study_tables()), rng, ("pi", "1", "2"), study_tables()), tokens=texts.TOKENS
    )


def make_fleet(rng: random.Random) -> bytes:
    seeds = tuple(texts.yaml_text(table).encode() for table in FLEETS)
    return either(rng, seeds, lambda rng: texts.structured(rng.choice(FLEETS), rng, ("pi",), study_tables()), tokens=texts.TOKENS)


def make_motion(rng: random.Random) -> bytes:
    table = {
        "controller": {"rate": 500, "reference": {"motion": MOTION}},
        "excitation": {"parts": [{k: v for k, v in part.items() if k != "p"} for part in MOTION["parts"]]},
    }
    return texts.structured(table, rng, ("pi", "1"), (table,))


def make_mat(rng: random.Random) -> bytes:
    return either(rng, mat_files(), lambda rng: archives.mat5(rng) if rng.random() < 0.8 else archives.mat4(rng))


def make_parquet(rng: random.Random) -> bytes:
    content = bytearray(rng.choice(parquet_files()))
    if rng.random() < 0.5:  # the footer, where shapes and places stand
        length = int.from_bytes(content[-8:-4], "little")
        for _ in range(rng.choice((1, 1, 2, 5))):
            content[len(content) - 8 - rng.randrange(length + 8 if rng.random() < 0.1 else length)] = rng.choice(
                (0, 0xFF, 0x7F, 0x80, rng.randrange(256))
            )
        return bytes(content)
    return mutated(bytes(content), rng, parquet_files())


def make_model(rng: random.Random) -> bytes:
    tokens = (
        *(
            word.encode()
            for word in (
                "(" * 10000 + ")" * 10000,
                "[" * 200,
                "-" * 20000 + "1",
                "not " * 5000,
                "1" + "+1" * 20000,
                "a" + ".b" * 5000,
                "9**9**9",
                "np.zeros(10**12)",
                "np.load('x')",
                "import os\n",
                "eval('1')",
                "().__class__",
                "f'{1}'",
                "lambda: 0",
                "yield",
                "while True: pass\n",
                "raise ValueError\n",
                "class A: pass\n",
                "\x00",
                "\f",
                "# coding: utf-7\n",
                "None",
                "0",
                "'x'",
                "{}",
                "np.nan",
                "JOINTS",
                "pass",
            )
        ),
    )
    return mutated(
        rng.choice(model_files()),
        rng,
        model_files(),
        tokens if rng.random() < 0.6 else (b"0", b"1", b"", b"\n", b"    ", b"q", b"np.", b"'", b"(", b")", b",", b"-1"),
    )


def make_checkpoint(rng: random.Random) -> bytes:
    members = {f"{name}.npy": archives.plain_npy(x) for name, x in checkpoint_arrays().items()}
    return archives.npz(members, rng) if rng.random() < 0.7 else mutated(archives.npz(members, random.Random(1)), rng)


# --- reading ----------------------------------------------------------------------------------------------------------


def read_robot(path: Path) -> object:
    from symgen.description.files import read_robot as read

    return read(path, nearly=1e-4)[0]


def read_and_derive(path: Path) -> object:
    """Small robots are derived and emitted as well, and the module is checked as a file is."""
    from runtime.model_source import check_source
    from symgen.description import load_robot
    from symgen.emit import generate_module

    robot = load_robot(path)
    if len(robot.frames) <= 5 and not robot.loops:
        check_source(generate_module(robot), path.name)
    return robot


def read_study(path: Path) -> object:
    from runtime.io.study_files import load_study
    from runtime.study import to_mapping
    from symgen.cli.session import study_text

    study = load_study(path)
    to_mapping(study)
    return study_text(study, path.parent, path.parent)


def read_fleet(path: Path) -> object:
    from symgen.cli.fleet_jobs import jobs_of

    return jobs_of(path)


def read_motion(path: Path) -> object:
    from runtime.io.study_files import load_study
    from runtime.reference import reference_of

    study = load_study(path)
    if study.controller is not None and study.controller.reference.motion is not None:
        return reference_of(study.controller, two_joints(), folder=path.parent)
    return study


@cache
def two_joints() -> object:
    from types import SimpleNamespace

    return SimpleNamespace(NAME="two", JOINTS=(1, 2), LIMITS={"q": ((-1e6, 1e6),) * 2, "qd": (1e6,) * 2, "qdd": (1e6,) * 2}, DRIVES=None)


def read_record(path: Path) -> object:
    """Whole and, where the format has it, by blocks: both give the same samples or both refuse."""
    from runtime.errors import InputError
    from runtime.io.records import read_record as read
    from runtime.io.streams import open_stream
    from runtime.io.table import BLOCK_READERS
    from runtime.study import RecordSettings

    settings = RecordSettings(files=(path.name,), columns=columns_of(path))
    whole: object = None
    refused: InputError | None = None
    try:
        whole = read(settings, folder=path.parent)
    except InputError as e:
        refused = e
    if path.suffix in BLOCK_READERS:
        try:
            stream = open_stream(settings, folder=path.parent, block=10)
            blocks = [q for _, q, _ in stream.blocks()]
        except InputError:
            if refused is None and path.suffix in (".csv", ".npy"):
                raise
        else:
            if refused is None and not np.array_equal(np.concatenate(blocks), whole.q):  # type: ignore[attr-defined]
                raise AssertionError("blocks and whole file differ")
    try:
        if refused is not None:
            raise refused
    finally:
        del refused  # an error that holds its own frame would hold what was read
    return whole


def columns_of(path: Path) -> Columns:
    from runtime.study import Columns

    if path.suffix == ".npy":
        return Columns(t="1", q=("2", "3"), tau=("4", "5"))
    return Columns(q=("a", "b"), tau=("a", "b")) if path.suffix[1:] in ("bag", "db3", "mcap") else Columns()


def read_model(path: Path) -> object:
    from runtime.model import load_model

    return load_model(path)


def read_checkpoint(path: Path) -> object:
    from runtime.checkpoint import Checkpoint

    folder = path.parent / "runs"
    folder.mkdir(exist_ok=True)
    (folder / "study.json").write_text("{}")
    path.replace(folder / "000000.npz")
    return Checkpoint(path.parent).resume({}, 2)


def read_json(path: Path) -> object:
    """A file of settings of a checkpoint, and an estimate."""
    from runtime.checkpoint import Checkpoint
    from runtime.errors import InputError
    from runtime.estimate import Estimate

    folder = path.parent / "runs"
    folder.mkdir(exist_ok=True)
    (folder / "study.json").write_bytes(path.read_bytes())
    with suppress(InputError):
        Checkpoint(path.parent).resume({}, 2)
    return Estimate.from_json(path.read_text(encoding="utf-8", errors="replace")).to_table()


def read_faulty(path: Path) -> object:
    """Does what its first line says: the harness is tested by it."""
    from runtime.errors import InputError

    match path.read_text():
        case "hang":
            while True:
                pass
        case "death":
            os.kill(os.getpid(), signal.SIGSEGV)
        case "memory":
            return [bytearray(2**26) for _ in range(100)]
        case "traceback":
            return {}["x"]
        case "unclear":
            raise InputError("wrong")
        case "control":
            error = InputError("", file="case")
            error.args = ("case: \x1b[2J",)
            raise error
    return None


FAULTY = Format("txt", lambda rng: b"ok", read_faulty, 0)

FORMATS: dict[str, Format] = {
    "robot": Format("yaml", make_robot, read_robot, 200),
    "expression": Format("yaml", make_expression, read_robot, 100),
    "derived": Format("yaml", make_derived, read_and_derive, 10, ("case.", "robot")),
    "par": Format("par", lambda rng: either(rng, par_files(), lambda rng: texts.par(rng.choice(par_files()), rng)), read_robot, 110),
    "urdf": Format("urdf", lambda rng: either(rng, urdf_files(), lambda rng: texts.xml(rng.choice(urdf_files()), rng)), read_robot, 110),
    "study": Format("yaml", make_study, read_study, 110),
    "fleet": Format("yaml", make_fleet, read_fleet, 20),
    "motion": Format("yaml", make_motion, read_motion, 20, ("case", "reference")),
    "csv": Format("csv", lambda rng: either(rng, (csv_file(),), lambda rng: texts.table(csv_file(), rng)), read_record, 80),
    "csv.gz": Format("csv.gz", lambda rng: archives.gzipped(rng.choice((csv_file(), texts.table(csv_file(), rng))), rng), read_record, 20),
    "npz": Format("npz", lambda rng: either(rng, (npz_file(),), lambda rng: archives.npz(npz_members(), rng), 0.8), read_record, 70),
    "npy": Format("npy", archives.npy, read_record, 30),
    "mat": Format("mat", make_mat, read_record, 50),
    "parquet": Format("parquet", make_parquet, read_record, 30),
    "mcap": Format("mcap", lambda rng: mutated(rng.choice(bag_files()["mcap"]), rng, bag_files()["mcap"]), read_record, 15),
    "bag": Format("bag", lambda rng: mutated(rng.choice(bag_files()["bag"]), rng, bag_files()["bag"]), read_record, 15),
    "db3": Format("db3", lambda rng: mutated(rng.choice(bag_files()["db3"]), rng, bag_files()["db3"]), read_record, 10),
    "model": Format("py", make_model, read_model, 20),
    "checkpoint": Format("npz", make_checkpoint, read_checkpoint, 10, ("000000.npz",)),
    "json": Format(
        "json", lambda rng: mutated(estimate_file(), rng, (estimate_file(),), texts.TOKENS), read_json, 10, ("estimate.json", "study.json")
    ),
}
