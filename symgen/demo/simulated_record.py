"""A simulated record of any robot that has VALUES and LIMITS: for a first look where no measured one can be had.

    q(t)    point to point between random way points: velocity ramps of the third degree, constant velocity between them
    tau     inverse dynamics of the emitted model with the base parameters of VALUES, plus white noise
    motors  qm = R (q - offset) rounded to the encoder step, taum = R'^-1 tau plus noise

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
from typing import Any, Literal

import numpy as np

from runtime import Record, Study
from runtime.model.drives import Drives
from runtime.model.generated import require
from runtime.motion.reference import Reference, point_to_point
from runtime.records.provenance import SIMULATED
from runtime.records.reading import read_records
from runtime.settings.controller import Points
from runtime.settings.study import Columns, RecordSettings

Array = np.ndarray

FILE = "simulated_record.csv.gz"
RATE = 5000.0  # Hz, as the public TX40 record
ENCODER = 2 * pi / 65536  # rad on the motor
NOISE = 0.02  # standard deviation of the torque noise, of the largest torque of each motor


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


def read_simulated(model: Any, study: Study, record: tuple[bytes, RecordSettings], note: str) -> Prepared:
    """A simulated record under the settings of `study`, read from its file like any other."""
    content, settings = record
    study = replace(study, record=(settings,))
    with TemporaryDirectory(prefix="symgen-") as folder:
        (Path(folder) / FILE).write_bytes(content)
        return Prepared(model, study, read_records(study.record, model, folder=Path(folder))[0], note, {FILE: content})


def motor_record(model: Any, duration: float, seed: int) -> tuple[bytes, RecordSettings]:
    """A .csv.gz file t,q1..qn,tau1..taun of the motor side, and the settings that read it."""
    return recorded(model, point_to_point(model, Points(duration, seed), RATE), seed)


def recorded(
    model: Any, path: Reference, seed: int, *, rate: float = RATE, encoder: float = ENCODER, noise: float = NOISE
) -> tuple[bytes, RecordSettings]:
    """The file, and the settings that read it, of a motion: motor positions in steps of `encoder`, torques with white noise.

    rate : Hz.   encoder : rad on the motor.   noise : standard deviation, of the largest torque of each motor.
    """
    require(model, "base_parameters", "inverse_dynamics")
    drives = Drives.from_mapping(model.DRIVES or {"ratio": np.eye(len(model.JOINTS))})
    X = model.base_parameters(model.VALUES)
    tau = model.inverse_dynamics(path.q, path.qd, path.qdd, X)
    command = drives.motor_command(tau)
    rng = np.random.default_rng([seed, 1])
    command += noise * np.abs(command).max(axis=0) * rng.standard_normal(command.shape)
    qm = encoder * np.round(drives.motor_position(path.q) / encoder)
    n = len(model.JOINTS)
    q_names, tau_names = (tuple(f"{letter}{j}" for j in range(1, n + 1)) for letter in ("q", "tau"))
    stream = BytesIO()
    np.savetxt(stream, np.column_stack([qm, command]), fmt="%.7g", delimiter=",", header=",".join((*q_names, *tau_names)), comments="")
    side: Literal["motor", "joint"] = "motor" if model.DRIVES is not None else "joint"
    name = f"{SIMULATED} {model.NAME}"
    settings = RecordSettings(files=(FILE,), columns=Columns(None, q_names, tau_names), side=side, rate=rate, name=name)
    return gzip.compress(stream.getvalue(), compresslevel=1, mtime=0), settings
