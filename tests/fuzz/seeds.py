"""Sound files of every format, from which cases are made: packaged robots, and small records made
at run time.
"""

from __future__ import annotations

import io
import json
from dataclasses import replace
from functools import cache
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from fuzz import archives, texts

ROBOTS = (
    "planar_2r",
    "emps_asymmetric",
    "scara",
    "two_branch",
    "emps",
    "stanford",
    "rx90",
    "four_bar",
    "sr400",
    "panda",
    "tx40",
)
ROWS = 12
COLUMNS = ("t", "q1", "q2", "tau1", "tau2")


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
    folder = Path(__file__).parents[1] / "description" / "par_files"
    return tuple(path.read_bytes() for path in sorted(folder.iterdir()))


@cache
def urdf_files() -> tuple[bytes, ...]:
    from symgen.description import load_robot
    from symgen.description.urdf import write_urdf

    loaded = [load_robot(name) for name in ("planar_2r", "scara", "stanford", "rx90")]
    return tuple(
        write_urdf(replace(robot, values=dict.fromkeys(robot.parameters, 0.25)))[0].encode()
        for robot in loaded
    )


@cache
def mjcf_files() -> tuple[bytes, ...]:
    from oracles.mjcf_robots import ARM, BRANCHES, GRIPPER

    return tuple(text.encode() for text in (BRANCHES, GRIPPER, ARM))


@cache
def record_columns() -> np.ndarray:
    """(ROWS, 5): t, q1, q2, tau1, tau2."""
    t = np.arange(ROWS) / 100
    return np.column_stack([t, np.sin(t), np.cos(t), t - 1, 2 * t])


@cache
def csv_file() -> bytes:
    return (
        "\n".join(
            [",".join(COLUMNS), *(",".join(map(repr, map(float, row))) for row in record_columns())]
        )
        + "\n"
    ).encode()


@cache
def npz_members() -> dict[str, bytes]:
    return {
        f"{name}.npy": archives.plain_npy(record_columns()[:, k]) for k, name in enumerate(COLUMNS)
    }


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
        more = (
            {}
            if settings.get("format")
            else {
                "s": {"a": 1.0, "b": ["x", "y"]},
                "c": np.array([1, "x"], dtype=object),
                "flag": True,
            }
        )
        savemat(
            stream,
            {name: record_columns()[:, k] for k, name in enumerate(COLUMNS)} | more,
            **settings,
        )
        found.append(stream.getvalue())
    return tuple(found)


@cache
def mat73_files() -> tuple[bytes, ...]:
    """HDF5 behind the text of 512 bytes that MATLAB writes, stored plainly and by compressed
    chunks.
    """
    import h5py

    found = []
    for settings in (
        {},
        {"chunks": (1, 5), "compression": "gzip", "shuffle": True, "fletcher32": True},
    ):
        stream = io.BytesIO()
        with h5py.File(stream, "w", userblock_size=512) as archive:
            for k, name in enumerate(COLUMNS):
                archive.create_dataset(name, data=record_columns()[None, :, k], **settings).attrs[
                    "MATLAB_class"
                ] = np.bytes_("double")
            archive.create_group("s").attrs["MATLAB_class"] = np.bytes_("struct")
            archive.create_dataset(
                "x", data=np.frombuffer("abc".encode("utf-16-le"), np.uint16)[None, :]
            ).attrs["MATLAB_class"] = np.bytes_("char")
        data = bytearray(stream.getvalue())
        data[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
        found.append(bytes(data))
    return tuple(found)


@cache
def parquet_files() -> tuple[bytes, ...]:
    import polars

    frame = polars.DataFrame(
        {name: record_columns()[:, k] for k, name in enumerate(COLUMNS)}
    ).with_columns(x=polars.lit("text"), i=polars.lit(3))
    found = []
    for compression in ("uncompressed", "snappy", "zstd", "gzip"):
        stream = io.BytesIO()
        frame.write_parquet(stream, compression=compression, row_group_size=5)
        found.append(stream.getvalue())
    return tuple(found)


@cache
def bags() -> tuple[dict[str, bytes], ...]:
    """Bags of ROWS messages, plain and compressed: the files of each by name."""
    from bag_files import KINDS, joint_states, write_bag

    stamps = 1_700_000_000_000_000_000 + 10_000_000 * np.arange(ROWS)
    x = record_columns()
    topics = {"/joint_states": joint_states(stamps, ("a", "b"), x[:, 1:3], x[:, 3:])}
    found = []
    for kind in KINDS:
        with TemporaryDirectory() as folder:
            path = write_bag(kind, Path(folder) / "run", topics)
            found.append(
                {
                    file.name: file.read_bytes()
                    for file in ([path] if path.is_file() else sorted(path.iterdir()))
                }
            )
    return tuple(found)


def bag_files(ending: str) -> tuple[bytes, ...]:
    """The files of that ending."""
    return tuple(data for bag in bags() for name, data in bag.items() if name.endswith(ending))


def bag_folders() -> tuple[dict[str, bytes], ...]:
    """ROS 2 bags."""
    return tuple(bag for bag in bags() if "metadata.yaml" in bag)


@cache
def bag_tables() -> tuple[dict, ...]:
    """What their descriptions say."""
    return tuple(texts.plain(bag["metadata.yaml"]) for bag in bag_folders())


@cache
def study_tables() -> tuple[dict, ...]:
    from runtime.ground.settings import to_mapping
    from runtime.reading.datasets import dataset_study
    from runtime.study import Study, study_from_mapping

    small = {
        "symgen": 1,
        "record": {"files": ["a.csv"], "rate": 1000},
        "cestac": {"delta": ["2*pi/10000"], "runs": 3},
    }
    rich = small | {
        "payload": {"record": {"files": ["b.csv"]}, "known": {"M": 2.0}, "gains": True},
        "controller": {
            "law": {"kind": "pid", "kp": [1.0, 2.0]},
            "rate": 500,
            "reference": {"points": {"duration": 10, "seed": 1}},
            "values": {"M1": 1},
        },
        "excitation": {
            "starts": 2,
            "spheres": [{"frame": 2, "radius": 0.1}],
            "limits": {"q": [[-1, 1], 2]},
        },
        "validate": {
            "split": [[0, 1], [1, 2]],
            "record": [
                {"files": ["c.csv"], "units": {"q": "deg", "tau": "A"}, "torque_constant": 0.1}
            ],
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


MOTION = {
    "parts": [
        {"family": "fourier", "period": 10.0, "harmonics": 2, "p": [[0.1] * 5] * 2},
        {"family": "point-to-point", "points": 3, "p": [[0.0, 0.1, 0.2]] * 2},
    ]
}


@cache
def model_files() -> tuple[bytes, ...]:
    from symgen.description import load_robot
    from symgen.emit.generate import generate_module

    return tuple(
        generate_module(load_robot(name)).encode() for name in ("planar_2r", "emps_asymmetric")
    )


def checkpoint_arrays() -> dict[str, np.ndarray]:
    return {
        "level": np.zeros(3, dtype=int),
        "run": np.arange(3),
        "X": np.ones((3, 2)),
        "residual_norm": np.ones(3),
    }


@cache
def estimate_file() -> bytes:
    from runtime.compose import estimate_of, observe
    from runtime.core.loading import run
    from runtime.core.model import load_model
    from runtime.core.record import Record
    from runtime.core.rows.observation import stack
    from runtime.study import study_from_mapping
    from symgen.description import load_robot
    from symgen.emit.generate import generate_module

    text = generate_module(load_robot("planar_2r"))
    model = load_model(run(text, Path("planar_2r.py")))
    rng, t = np.random.default_rng(1), np.arange(400) / 100
    record = Record(
        t, np.sin(t[:, None] * [1.0, 2.3]), rng.standard_normal((400, 2)), rate=100.0, name="x"
    )
    study = study_from_mapping({"signals": {"lowpass": None, "decimate": None}})
    return (
        estimate_of(stack([observe(model, record, study)]), study.estimate, model=model)
        .to_json()
        .encode()
    )
