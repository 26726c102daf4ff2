"""Problems of a planar arm, one for each feature that changes a problem before it is fitted.

    problem = FEATURES["known torques"](folder)      model, records, records that are predicted, study

Records are short, their torques those of the emitted module with white noise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import symgen
from runtime.core.record import Record
from runtime.reading.records import read_records
from runtime.study import Study, study_from_mapping
from runtime.wrench import WrenchModel
from symgen.description.yaml import parse_robot

ARM = """
symgen: 1
name: arm
gravity: [0, -g, 0]
constants: {D2: 0.5, g: 9.81, temperature: 25}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: 0, d: D2, theta: q2, r: 0}
elements:
  Ia: {kind: inertia, along: all}
  FV: {kind: viscous, along: all}
  FS: {kind: coulomb, along: all}
limits: {q: [pi, pi], qd: [3, 5], qdd: [20, 40], tau: [60, 25]}
values: {XX1: 0.0012, XY1: 0, XZ1: 0, YY1: 0.1673, YZ1: 0, ZZ1: 0.1673, MX1: 0.5, MY1: 0, MZ1: 0, M1: 2, Ia1: 0.05, FV1: 0.5, FS1: 0.8,
   XX2: 0.0012, XY2: 0, XZ2: 0, YY2: 0.1673, YZ2: 0, ZZ2: 0.1673, MX2: 0.5, MY2: 0, MZ2: 0, M2: 2, Ia2: 0.02, FV2: 0.3, FS2: 0.4%s}
%s
"""
STRIBECK = "columns: {STR: {kind: stribeck, along: all, fit: {vs: {bounds: [0.05, 1]}}}}"
LOADED = "columns: {LD: {kind: load_dependent, along: 2}}"
WARM = 'columns: {FT: {along: all, torque: "sign(qd)*(channel.temperature/25 - 1)", unit: N*m}}'
OWN = 'columns: {CAB: {along: 2, torque: "sin(3*q)", unit: N*m}}'
DRIVES = "drives: {ratio: [[50, 0], [10, 30]], torque_constant: 1}"

RATE = 200.0  # Hz
SECONDS = 8.0
STEP = 1e-3  # rad, of the encoders of counts
CESTAC = {"delta": [2e-3], "runs": 2}
SIGNALS = {"median": 1, "lowpass": {"cutoff": 20}}
LAW = {"kp": 200.0, "kd": 8.0}


@dataclass(frozen=True)
class Case:
    """Model, records that are fitted, records that are predicted, study."""

    model: Any
    records: tuple[Record, ...]
    unseen: tuple[Record, ...]
    study: Study
    feature: str = ""


def arm(columns: str = "", values: str = "", options: tuple[str, ...] = ()) -> Any:
    """The module of the arm with further sections of the robot file, and values of their parameters."""
    return _arm(columns, values, options)


@cache
def _arm(columns: str, values: str, options: tuple[str, ...]) -> Any:
    robot = parse_robot((ARM % (values, columns)).encode(), "arm.yaml")
    return symgen.model(robot, options=options)


def motion(seed: int, rate: float = RATE, seconds: float = SECONDS) -> tuple[Any, ...]:
    """t, q, qd, qdd of five sines of each joint."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    a = rng.uniform(0.1, 0.4, (5, 2))
    phase = rng.uniform(0, 6, (5, 2))
    w = 2 * np.pi * 0.2 * np.arange(1, 6)[:, None]
    angle = w * t[:, None, None] + phase
    q = (a * np.sin(angle)).sum(axis=1)
    qd = (a * w * np.cos(angle)).sum(axis=1)
    qdd = -(a * w**2 * np.sin(angle)).sum(axis=1)
    return t, q, qd, qdd


def parameters(model: Any) -> Any:
    """X of the values of the robot file."""
    return model.base_parameters({name: model.VALUES[name] for name in model.STANDARD_PARAMETERS})


def noise(seed: int, shape: tuple[int, ...], deviation: float = 0.03) -> Any:
    """White noise."""
    return deviation * np.random.default_rng(seed + 100).standard_normal(shape)


def record(
    model: Any, seed: int, rate: float = RATE, seconds: float = SECONDS, **functions: Any
) -> Record:
    """A record of the motion; functions : constants and channels of the module."""
    t, q, qd, qdd = motion(seed, rate, seconds)
    tau = model.inverse_dynamics(q, qd, qdd, parameters(model), **functions)
    return Record(t, q, tau + noise(seed, q.shape), rate=rate, name=f"run {seed}")


def study(**sections: Any) -> Study:
    """Settings without anything automatic, but as given."""
    signals = SIGNALS | sections.pop("signals", {})
    return study_from_mapping({"signals": signals, "cestac": CESTAC, **sections})


def pair(
    model: Any, change: Callable[[Record], Record] = lambda record: record, **options: Any
) -> tuple[tuple[Record, ...], tuple[Record, ...]]:
    """A record that is fitted and one that is predicted."""
    return (change(record(model, 0, **options)),), (change(record(model, 1, **options)),)


def plain(folder: Path) -> Case:
    model = arm()
    return Case(model, *pair(model), study())


def force_sensors(folder: Path) -> Case:
    model = arm(options=("base_wrench_regressor",))
    sensors = WrenchModel(model, [0], True)
    offsets = [1.0, -2.0, 0.5, 0.1, 0.2, -0.1]
    standard = [model.VALUES[name] for name in model.STANDARD_PARAMETERS]
    X = sensors.base_parameters(np.array(standard + offsets))

    def measured(seed: int) -> Record:
        t, q, qd, qdd = motion(seed)
        rest = np.zeros((len(t), 6))
        states = [np.hstack([x, rest]) for x in (q, qd, qdd)]
        tau = sensors.inverse_dynamics(*states, X)
        tau += noise(seed, tau.shape)
        wrench = {"wrench0": tau[:, 2:]}
        return Record(t, q, tau[:, :2], rate=RATE, name=f"run {seed}", channels=wrench)

    return Case(model, (measured(0),), (measured(1),), study())


def link_side(folder: Path) -> Case:
    model = arm()
    links = {name: model.VALUES[name] for name in model.STANDARD_PARAMETERS}
    links |= {name: 0.0 for name in links if name[:2] in ("Ia", "FV", "FS")}

    def measured(seed: int) -> Record:
        t, q, qd, qdd = motion(seed)
        tau = model.inverse_dynamics(q, qd, qdd, model.base_parameters(links))
        return Record(t, q, tau + noise(seed, q.shape), rate=RATE, name=f"run {seed}")

    settings = study(record={"side": "link"})
    return Case(model, (measured(0),), (measured(1),), settings)


def poses_at_rest(folder: Path) -> Case:
    model = arm()

    def measured(seed: int) -> Record:
        q = np.random.default_rng(seed).uniform(-2, 2, (60, 2))
        tau = model.inverse_dynamics(q, 0 * q, 0 * q, parameters(model))
        poses = np.arange(60.0)
        return Record(poses, q, tau + noise(seed, q.shape), rate=1.0, name=f"poses {seed}")

    return Case(model, (measured(0),), (measured(1),), study(signals={"reader": "static"}))


def fitted_scalars(folder: Path) -> Case:
    model = arm(STRIBECK, ", STR1: 1.5, STR2: 0.8")
    return Case(model, *pair(model, vs1=0.3, vs2=0.3), study())


def transmitted_torque(folder: Path) -> Case:
    model = arm(LOADED, ", LD2: 0.15")
    X = parameters(model)
    rest = [k for k, name in enumerate(model.BASE_PARAMETERS) if name != "LD2"]

    def measured(seed: int) -> Record:
        t, q, qd, qdd = motion(seed)
        zero = np.zeros(len(t))
        tau = model.regressor(q, qd, qdd, tau_model2=zero)[..., rest] @ X[rest]
        tau[:, 1] += 0.15 * np.abs(tau[:, 1]) * np.sign(qd[:, 1])
        return Record(t, q, tau + noise(seed, q.shape), rate=RATE, name=f"run {seed}")

    return Case(model, (measured(0),), (measured(1),), study())


def _by_law(folder: Path, late: float = 0.0, **law: Any) -> Case:
    model = arm()
    for seed in (0, 1):
        t, q, qd, qdd = motion(seed)
        tau = model.inverse_dynamics(q, qd, qdd, parameters(model))
        ahead = np.array([np.interp(t + late, t, x) for x in tau.T]).T
        followed = q + (ahead + LAW["kd"] * qd - LAW["kd"] * 1.1 * qd) / LAW["kp"]
        arrays = {"t": t, "q": q, "qd": qd, "r": followed, "rd": 1.1 * qd}
        np.savez(folder / f"law{seed}.npz", **arrays)
    columns = {"t": "t", "q": "q", "qd": "qd", "q_ref": "r", "qd_ref": "rd"}
    both = [{"files": str(folder / f"law{seed}.npz"), "columns": columns} for seed in (0, 1)]
    settings = study(record=both[0], validate={"record": both[1]}, controller={"law": LAW | law})
    fitted = read_records(settings.record, model)
    unseen = read_records(settings.validate.record, model)
    return Case(model, tuple(fitted), tuple(unseen), settings)


def law_with_gain(folder: Path) -> Case:
    return _by_law(folder, kd="fit")


def law_with_delay(folder: Path) -> Case:
    return _by_law(folder, late=0.004, delay="fit")


def counts(folder: Path) -> Case:
    model = arm()
    records = pair(model, lambda r: replace(r, q=STEP * np.round(r.q / STEP)), seconds=5.0)
    settings = study(
        signals={"reader": "counts", "step": STEP}, cestac=CESTAC | {"rounding": "phase"}
    )
    return Case(model, *records, settings)


def missing_samples(folder: Path) -> Case:
    case = counts(folder)
    samples = np.zeros((len(case.records[0]), 2), dtype=bool)
    samples[400:403, 0] = True

    def with_gap(record: Record) -> Record:
        return Record(record.t, record.q, record.tau, rate=RATE, name=record.name, missing=samples)

    records = tuple(map(with_gap, case.records))
    return replace(case, records=records, unseen=tuple(map(with_gap, case.unseen)))


def slower_bus(folder: Path) -> Case:
    """Each row is written four times: a bus of a quarter of the rate."""

    def logged(record: Record) -> Record:
        first = np.arange(len(record)) // 4 * 4
        return replace(record, q=record.q[first], tau=record.tau[first])

    model = arm()
    records = pair(model, logged)
    return Case(model, *records, study())


def automatic_cutoff(folder: Path) -> Case:
    model = arm()
    return Case(model, *pair(model), study(signals={"lowpass": {"cutoff": "auto"}}))


def torque_median(folder: Path) -> Case:
    """Drives that push by pulses, which a median takes away."""
    model = arm()

    def pulsed(record: Record) -> Record:
        pulses = np.zeros(len(record))
        pulses[::5] = 5.0
        return replace(record, tau=record.tau * (0.7 + 0.3 * pulses[:, None]))

    signals = {"median": 5, "torque_median": 5}
    return Case(model, *pair(model, pulsed), study(signals=signals))


def recorded_speeds(folder: Path) -> Case:
    model = arm()

    def measured(seed: int) -> Record:
        one = record(model, seed)
        qd = motion(seed)[2] + noise(seed + 7, one.q.shape, 1e-3)
        q = one.q + noise(seed + 9, one.q.shape, 1e-4)
        return replace(one, q=q, channels={"qd": qd})

    return Case(model, (measured(0),), (measured(1),), study())


def known_torques(folder: Path) -> Case:
    model = arm()

    def balanced(record: Record) -> Record:
        known = np.column_stack([3.0 * np.cos(record.q[:, 0]), np.zeros(len(record))])
        return replace(record, tau=record.tau + known, tau_known=known)

    return Case(model, *pair(model, balanced), study())


def own_columns(folder: Path) -> Case:
    model = arm(OWN, ", CAB2: 0.7")
    return Case(model, *pair(model), study())


def channels(folder: Path) -> Case:
    model = arm(WARM, ", FT1: 0.9, FT2: -0.7")

    def measured(seed: int) -> Record:
        temperature = 20 + 20 * np.arange(round(SECONDS * RATE)) / (SECONDS * RATE)
        one = record(model, seed, temperature=temperature)
        return replace(one, channels={"temperature": temperature[:, None]})

    return Case(model, (measured(0),), (measured(1),), study())


def motor_side(folder: Path) -> Case:
    model = arm(DRIVES)
    settings = study(cestac={"delta": [0.05], "runs": 2, "side": "motor"})
    return Case(model, *pair(model), settings)


def drive_commands(folder: Path) -> Case:
    """Torques in amperes of drives of unknown torque constant."""
    model = arm()

    def commanded(record: Record) -> Record:
        return replace(record, tau=record.tau / 2, origin=replace(record.origin, command="A"))

    return Case(model, *pair(model, commanded), study())


def different_rates(folder: Path) -> Case:
    model = arm()
    records = (record(model, 0, rate=250.0), record(model, 2, rate=125.0))
    return Case(model, records, (record(model, 1),), study())


def gaps(folder: Path) -> Case:
    """A log without half a second in the middle, which is two records."""
    model = arm()
    one = record(model, 0)
    kept = np.r_[0:700, 800 : len(one)]
    columns = {"t": "t", "q": ["q1", "q2"], "tau": ["tau1", "tau2"]}
    table = np.column_stack([one.t, one.q, one.tau])[kept]
    header = "t,q1,q2,tau1,tau2"
    np.savetxt(folder / "log.csv", table, "%.12g", ",", header=header, comments="")
    resample = {"rate": RATE, "gaps": "split"}
    log = {"files": str(folder / "log.csv"), "columns": columns, "resample": resample}
    settings = study(record=log)
    return Case(model, tuple(read_records(settings.record, model)), (record(model, 1),), settings)


FEATURES: Mapping[str, Callable[[Path], Case]] = {
    "nothing": plain,
    "force sensors": force_sensors,
    "link side": link_side,
    "poses at rest": poses_at_rest,
    "fitted scalars": fitted_scalars,
    "transmitted torque": transmitted_torque,
    "law, kd: fit": law_with_gain,
    "law, delay: fit": law_with_delay,
    "counts": counts,
    "missing samples": missing_samples,
    "slower bus": slower_bus,
    "automatic cut-off": automatic_cutoff,
    "torque median": torque_median,
    "recorded speeds": recorded_speeds,
    "known torques": known_torques,
    "own columns": own_columns,
    "channels": channels,
    "motor side": motor_side,
    "drive commands": drive_commands,
    "different rates": different_rates,
    "gaps": gaps,
}
