"""A simulated record of any robot that has VALUES and LIMITS: for a first look where no measured
one can be had.

    tau     inverse dynamics of the emitted model with the base parameters of VALUES
    motors  qm = R (q - offset) rounded to the encoder step, taum = R'^-1 tau plus white noise

Nothing here was measured, and the fit is better than that of any real arm: the model is exact.
"""

from __future__ import annotations

import gzip
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from io import BytesIO
from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import runtime
from runtime import Record, Study
from runtime.loop.reference import Reference
from runtime.model.drives import Drives
from runtime.settings.study import Columns, RecordSettings

FILE = "simulated_record.csv.gz"
ENCODER = 2 * pi / 65536  # rad on the motor


@dataclass(frozen=True, eq=False)
class Prepared:
    """What a demonstration starts from.

    Attributes
    ----------
    model : module
        Emitted module.
    study : Study
        Files relative to the output folder.
    record : Record
    note : str
        Why the record is simulated; "" of a measured one.
    files : mapping of str to bytes
        The simulated record, by file name.
    """

    model: Any
    study: Study
    record: Record
    note: str = ""
    files: Mapping[str, bytes] = field(default_factory=dict)


def simulated_record(
    model: Any,
    study: Study,
    path: Reference,
    note: str,
    *,
    seed: int,
    encoder: float = ENCODER,
    noise: float = 0.02,
) -> Prepared:
    """The record of a motion, written as a .csv.gz file q1..qn,tau1..taun of the motor side and
    read from it like any other.

    study : settings but for the record. encoder : rad on the motor. noise : standard deviation, of
    the largest torque of each motor.
    """
    n = len(model.JOINTS)
    drives = Drives.from_mapping(model.DRIVES or {"ratio": np.eye(n)})
    tau = model.inverse_dynamics(path.q, path.qd, path.qdd, model.base_parameters(model.VALUES))
    torque = drives.motor_command(tau)
    white = np.random.default_rng([seed, 1]).standard_normal(torque.shape)
    torque += noise * np.abs(torque).max(axis=0) * white
    position = encoder * np.round(drives.motor_position(path.q) / encoder)
    q, t = (tuple(f"{letter}{j}" for j in range(1, n + 1)) for letter in ("q", "tau"))
    stream, header = BytesIO(), ",".join((*q, *t))
    table = np.column_stack([position, torque])
    np.savetxt(stream, table, fmt="%.7g", delimiter=",", header=header, comments="")
    content = gzip.compress(stream.getvalue(), compresslevel=1, mtime=0)
    settings = RecordSettings(
        files=(FILE,),
        columns=Columns(None, q, t),
        side="joint" if model.DRIVES is None else "motor",
        rate=path.rate,
        name=f"SIMULATED {model.NAME}",
        simulated=True,
    )
    with TemporaryDirectory(prefix="symgen-") as folder:
        (Path(folder) / FILE).write_bytes(content)
        record = runtime.read_record(settings, model, folder=folder)
    return Prepared(model, replace(study, record=(settings,)), record, note, {FILE: content})
