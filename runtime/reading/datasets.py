"""Public measured records: their addresses, their hashes, and the settings for their use.

    fetch("tx40", "pos_read_data.csv")       path of the file
    dataset_study("tx40")                    settings as read from a study file

A file is searched in the folder SYMGEN_DATA as <name>/<file> or <name>/<file>.gz (which is never
changed), then in the cache of the user, then at its source. Hashes are of the uncompressed bytes.
The records belong to their authors and are not part of this package.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.ground.errors import DataUnavailableError, InputError
from runtime.reading.files import is_file, sha256_of

TIMEOUT = 10.0  # s, for a connection and between two packets


@dataclass(frozen=True)
class Dataset:
    """A public measured record: its source, its licence, its files and its settings.

    url : folder of the files. files : SHA-256 of the uncompressed bytes, by name. study : settings
    for this record.
    """

    title: str
    source: str
    licence: str
    url: str
    files: Mapping[str, str]
    study: Mapping[str, Any]


TX40 = Dataset(
    title="Stäubli TX40, motor positions and motor torques, 9 s at 5 kHz",
    source="github.com/thanhndv212/figaroh-examples, examples/staubli_TX40/data",
    licence="Apache-2.0",
    url="https://raw.githubusercontent.com/thanhndv212/figaroh-examples/c0b5c7f0fda10078be55104f9ee76ac106b7a5ee/examples/staubli_TX40/data/",
    files={
        "pos_read_data.csv": "5cc1cecc1024ef0e331d0caba06f689456ab789ec3f1e904599c0a8be5c27bc8",
        "curr_data.csv": "f4592f4ba4db42f5d7625688986be25b575ca34d0504b27979ca6b0276bd3af9",
    },
    study={
        "record": {
            "dataset": "tx40",
            "files": ["pos_read_data.csv", "curr_data.csv"],
            "columns": {
                "q": [f"Joint_{j}" for j in range(1, 7)],
                "tau": [f"Joint_{j}" for j in range(1, 7)],
            },
            "side": "motor",
            "rate": 5000,
            "units": {"q": "rad", "tau": "N*m"},
        },
        "signals": {
            "median": 5,
            "torque_median": 5,
            "lowpass": {"cutoff": 50, "order": 4, "on": ["q", "qd"]},
            "decimate": {"factor": "auto", "phase": "first"},
        },
        "rows": {
            "window": [0, 7.5],
            "trim": 3,
            "low_speed": 0,
        },  # afterwards at rest: sign(qd) chatters and the torque creeps
        "essential": {"first": True},
        "validate": {"split": [[0, 3.7], [3.7, 7.5]]},
    },
)

_EMPS_RECORD: dict[str, Any] = {
    "dataset": "emps",
    "files": ["DATA_EMPS.mat"],
    "columns": {"t": "t", "q": ["qm"], "tau": ["vir"], "q_ref": ["qg"]},
    "scale": {"tau": "gtau"},  # force = gtau*vir, N/V
    "side": "joint",
    "rate": 1000,
    "units": {"t": "s", "q": "m", "tau": "N"},
    "name": "emps",
}

EMPS = Dataset(
    title=(
        "EMPS, electro-mechanical positioning system, one prismatic axis, 2 x 24.8 s at 1 kHz "
        "(Janot, Gautier and Brunot, 2019)"
    ),
    source="github.com/forgi86/sysid-neural-continuous, examples/EMPS/data",
    licence="Apache-2.0 (repository); none stated in the data description",
    url="https://raw.githubusercontent.com/forgi86/sysid-neural-continuous/956aa7ecd73061b0321c6f6098d74c9e4a7ce67a/examples/EMPS/data/",
    files={
        "DATA_EMPS.mat": "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e",
        "DATA_EMPS_PULSES.mat": "0eab75bb1f6b16228ee78791343a88bf9bfd9a51036ac9807d7b5fc11c0e1704",
    },
    study={  # the steps of the authors' description, section 3.4
        "record": _EMPS_RECORD,
        "signals": {
            "median": 1,
            "lowpass": {"cutoff": 100, "order": 4, "on": ["q"], "padding": "matlab"},
            "decimate": {"factor": 10, "phase": "last", "padding": "matlab"},
        },
        "rows": {
            "window": [0.0485, None],
            "trim": 0,
            "low_speed": 0,
        },  # without the first 49 samples
        "essential": {"first": True},
        "validate": {
            "record": [{**_EMPS_RECORD, "files": ["DATA_EMPS_PULSES.mat"], "name": "emps_pulses"}]
        },
        "cestac": {"delta": [1e-6, 2e-5, 5e-5, 1e-4]},  # m
        "controller": {  # the authors' Simulink diagram
            "law": {"kind": "cascade", "kp": 160.18, "kv": 243.45, "gain": 35.15065188248547},
            "rate": 1000,
            "delay": 1,
            "velocity": "averaged",
            "reference": {"record": 0},
        },
    },
)

DATASETS: Mapping[str, Dataset] = {"tx40": TX40, "emps": EMPS}


def listing() -> list[dict[str, Any]]:
    """List all public datasets as JSON values: name, title, source, licence and files.

    Each file has its address, its hash and its path, which is None if the file is not on this
    machine.
    """
    rows: list[dict[str, Any]] = []
    for name, dataset in DATASETS.items():
        files = []
        for file, digest in dataset.files.items():
            path = locate(name, file)
            address = {"name": file, "url": dataset.url + file, "sha256": digest}
            files.append({**address, "path": None if path is None else str(path)})
        about = {"title": dataset.title, "source": dataset.source, "licence": dataset.licence}
        rows.append({"name": name, **about, "files": files})
    return rows


def dataset_study(name: str) -> dict[str, Any]:
    """Return a copy of the study settings of a public dataset, for `study_from_mapping`."""
    return copy.deepcopy(dict(_dataset(name).study))


def locate(name: str, file: str, *, cache: Path | None = None) -> Path | None:
    """Return the path of a file of a public dataset on this machine; None if this machine does not
    have it.

    The hash of the file is checked.
    """
    path, _ = _local(name, file, cache)
    return path


def fetch(name: str, file: str, *, cache: Path | None = None) -> Path:
    """Return the path of a file of a dataset: a file on this machine, or else a download from its
    source.

    Raise DataUnavailableError if neither is possible.
    """
    path, tried = _local(name, file, cache)
    if path is not None:
        return path
    import pooch  # 25 ms, where the file is not in SYMGEN_DATA

    dataset = _dataset(name)
    folder = _cache(cache) / name
    source = pooch.create(
        path=folder,
        base_url=dataset.url,
        registry={k: f"sha256:{v}" for k, v in dataset.files.items()},
        retry_if_failed=0,
    )
    try:
        return Path(source.fetch(file, downloader=pooch.HTTPDownloader(timeout=TIMEOUT)))
    except (OSError, ValueError) as e:
        reason = f"{type(e).__name__}: {e}"[:200]
        tried.append(f"download of {dataset.url}{file}: {reason}")
    lines = "\n".join(f"  - {line}" for line in tried)
    raise DataUnavailableError(
        f"{name}/{file} was found nowhere:\n{lines}\nPut it at <folder>/{name}/{file} (or {file}.gz) and set the environment variable SYMGEN_DATA to <folder>.",
        tried=tuple(tried),
    )


def _local(name: str, file: str, cache: Path | None) -> tuple[Path | None, list[str]]:
    """Search for a file of a dataset on this machine; return its path or None, and failed attempts."""
    expected = _digest(name, file)
    tried: list[str] = []
    data = os.environ.get("SYMGEN_DATA")
    if data:
        for path in (Path(data) / name / file, Path(data) / name / f"{file}.gz"):
            if is_file(path):
                digest = sha256_of(path)
                if digest != expected:
                    raise InputError(
                        f"the file has the SHA-256 hash {digest}; expected {expected}, the hash of "
                        "the public record: replace or remove the file",
                        file=str(path),
                    )
                return path, tried
        tried.append(f"SYMGEN_DATA={data}: no {name}/{file}, no {name}/{file}.gz")
    else:
        tried.append("SYMGEN_DATA is not set")
    cached = _cache(cache) / name / file
    if cached.is_file() and sha256_of(cached) == expected:
        return cached, tried
    tried.append(f"cache {cached}: {'another hash' if cached.is_file() else 'no such file'}")
    return None, tried


def _dataset(name: str) -> Dataset:
    if name not in DATASETS:
        raise InputError(f"there is no dataset {name!r}; expected one of {', '.join(DATASETS)}")
    return DATASETS[name]


def _digest(name: str, file: str) -> str:
    files = _dataset(name).files
    if file not in files:
        raise InputError(f"dataset {name} has no file {file!r}; its files are {', '.join(files)}")
    return files[file]


def _cache(cache: Path | None) -> Path:
    if cache is not None:
        return cache
    import pooch

    return Path(pooch.os_cache("symgen"))
