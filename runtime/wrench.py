"""Use force sensors: each adds six rows to W and Y per sample, three forces and three moments.

A sensor before link j measures the wrench (force and moment) that moves link j and the links behind
it, in the axes of frame j about its origin. This wrench equals the torques of six additional joints
that stay at zero, in the same way as the base wrench of a floating base. So the model with a sensor
has six more joints, which do not move,

    [Y ]   [D K]         [0]
    [  ] = [   ] chi  +  [ ] b ,        w = WS(q, qd, qdd) chi + b
    [w ]   [WS ]         [1]

chi are the standard parameters, X = K chi the base parameters of the joint torques, and b the
offset of the sensor. WS has the columns of `base_wrench_regressor` of these links, moved from the
origin of frame 0 to frame j. A wrench depends on parameters that no joint torque depends on, but on
no parameter of the drives: the moment of the rotor itself on the base (its inertia times the gear
ratio, once) is neglected.

The base parameters differ from those of the module. They are found numerically, for the constants
of the robot file, as the columns that do not depend on the columns before them, at random states,
and the linear combinations of standard parameters that belong to these columns (Gautier 1991).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from runtime.core.contacts import settings_of_axes, with_axes
from runtime.core.model import BoundModel, GeneratedModel, channels_of, elements_of, joint_units
from runtime.core.problem import Problem
from runtime.core.record import WRENCH, Record
from runtime.ground.errors import InputError
from runtime.physical.inertia import INERTIAL, physical_model

Array = np.ndarray

AXES = ("FX", "FY", "FZ", "NX", "NY", "NZ")
TEN_UNITS = ("kg*m**2",) * 6 + ("kg*m",) * 3 + ("kg",)  # in the order of INERTIAL
PROBED_STATES = 64  # random ones that tell columns apart
LEFT_OF_COLUMN = 1e-8  # of the norm of a column: less is left of it beside those before


def force_sensors(problem: Problem) -> Problem:
    """Add six fixed joints per force sensor to model and records; their torques are the wrench.

    This is a step of the preparation of a problem. A problem without force sensors is not changed.

    Sensors are the channels wrench0, wrench7 ..., shape (N, 6), N and N m: wrench0 is below the
    robot, wrench7 before link 7. Joint torques that are zero in all fitted records count as not
    measured and give no rows. If the method is ols, it becomes wls with a weight for each joint and
    axis, because N and N m cannot be added.

    Raises
    ------
    InputError
        Torques are in A or V although the wrench is in N and N m and both share parameters; the
        module has no function base_wrench_regressor, or lacks the frame of a sensor; a robot with
        loops has a sensor that is not below it; a record lacks one of the sensors; or the reader is
        that of encoder counts.
    """
    records = (*problem.records, *problem.unseen)
    channels = sorted({c for r in records for c in r.measured if re.fullmatch(rf"{WRENCH}\d+", c)})
    if not channels:
        return problem
    for record in records:
        for c in channels:
            if record.channels.get(c, np.empty((0, 0))).shape[1] != 6:
                raise InputError(
                    f"three forces and three moments of the sensor in frame {c.removeprefix(WRENCH)} "
                    "are needed in every record: write record.columns: "
                    f"{{wrench: {{{c.removeprefix(WRENCH)}: [...]}}}} in the study, with six columns",
                    file=record.file,
                )
    for record in records:
        if record.origin.command:
            raise InputError(
                f"the joint torques are in {record.origin.command}, but the force sensor measures N "
                "and N m, and both share parameters; give record.torque_constant (N*m/A or N*m/V) of "
                "every joint in the study, or leave out the columns tau or the columns wrench of the "
                "record",
                file=record.file,
            )
    settings = problem.settings
    if not problem.reader.linear:
        raise InputError(
            f"signals.reader: {settings.signals.reader} does not support force sensors; write signals: {{reader: lowpass}} in the study, or remove record.columns.wrench"
        )
    n = len(problem.model.JOINTS)
    torques = any(record.tau.any() for record in problem.records)
    settings = settings_of_axes(settings, n, 6 * len(channels), torques, problem.methods)

    def sensed(record: Record) -> Record:
        return with_axes(record, [record.channels[c] for c in channels])

    frames = [int(c.removeprefix(WRENCH)) for c in channels]
    return problem.changed(
        model=WrenchModel(problem.model, frames, torques),
        records=tuple(sensed(record) for record in problem.records),
        unseen=tuple(sensed(record) for record in problem.unseen),
        settings=settings,
    )


class WrenchModel:
    """A robot model with six additional fixed joints for each force sensor.

    The torques of these joints are the wrench that the sensor measures.

    Parameters
    ----------
    model : GeneratedModel
        Emitted with the function base_wrench_regressor.
    sensors : sequence of int
        Numbers of the frames in which the sensors measure; 0 is the base.
    torques : bool
        Whether joint torques are measured too; the base parameters differ in the two cases.
    """

    DRIVES = None

    def __init__(self, model: GeneratedModel, sensors: Sequence[int], torques: bool) -> None:
        frames, self._model, self._n = getattr(model, "ANTECEDENTS", None), model, len(model.JOINTS)
        if frames is None:
            raise InputError(
                f"{model.NAME} has no base_wrench_regressor; generate the module with symgen generate "
                "ROBOT --with base_wrench_regressor"
            )
        if wrong := [f for f in sensors if f and (f not in frames or hasattr(model, "PASSIVE"))]:
            why = "links behind it are in loops" if wrong[0] in frames else "no such frame"
            raise InputError(
                f"a wrench in frame {wrong[0]} of {model.NAME} is not possible: {why}; frame 0 is the base"
            )
        standard = physical_model(model).standard
        rows = tuple(f"{axis}{f}" for f in sensors for axis in AXES)
        self.JOINTS = (*model.JOINTS, *rows)
        self.STANDARD_PARAMETERS = (*standard, *(f"B{row}" for row in rows))
        path = {0: {0}}
        for j, i in sorted(frames.items()):
            path[j] = {j} | path[i]
        link = {f"{p}{j}": path[j] for j in frames for p in INERTIAL}
        self._behind = {f: [f in link.get(name, ()) for name in standard] for f in sensors}
        of_joints = {name.removesuffix("R") for name in model.BASE_PARAMETERS}
        order = sorted(range(len(standard)), key=lambda k: standard[k] not in of_joints)
        A, self._used = self._probed({}), slice(0 if torques else self._n, None)
        order += range(len(standard), A.shape[2])
        self._columns = _independent(A[:, self._used].reshape(-1, A.shape[2]), order)
        K = self._regrouped({})
        own_names = [self.STANDARD_PARAMETERS[k] for k in self._columns]
        self.BASE_PARAMETERS = tuple(
            name + "R" * int((x != 0).sum() > 1) for name, x in zip(own_names, K, strict=True)
        )
        self.STRUCTURE = np.abs(A[..., self._columns]).max(axis=0).T > 0
        self.FORMULAS = {
            name: " ".join(
                f"{x:+.6g}*{k}" for k, x in zip(self.STANDARD_PARAMETERS, row, strict=True) if x
            )
            for name, row in zip(self.BASE_PARAMETERS, K, strict=True)
            if name.endswith("R")
        }
        units = getattr(model, "UNITS", {})
        units = {name.removesuffix("R"): unit for name, unit in units.items()}
        units |= {f"{p}{j}": u for p, u in zip(INERTIAL, TEN_UNITS, strict=True) for j in frames}
        units |= {f"B{row}": "N" if row[0] == "F" else "N*m" for row in rows}
        of_axes = ("m" if row[0] == "F" else "rad" for row in rows)
        self.JOINT_UNITS = (*joint_units(model), *of_axes)
        slides = dict(zip(self.JOINTS, self.JOINT_UNITS, strict=True))
        rotors = {  # which a base parameter of joint torques may hold
            name: "kg" if all(slides.get(j) == "m" for j in along) else "kg*m**2"
            for name, (kind, _, along) in elements_of(model).items()
            if kind == "inertia"
        }
        pairs = zip(self.BASE_PARAMETERS, own_names, strict=True)
        self.UNITS = {name: (rotors | units).get(own, "") for name, own in pairs}

    def __getattr__(self, name: str) -> Any:
        if not name.isupper() or name.startswith("_"):
            raise AttributeError(name)
        return self.elements() if name == "ELEMENTS" else getattr(self._model, name)

    def elements(self, **constants: float) -> dict[str, Any]:
        """Return the joint elements of the model, such as friction, and the sensor offsets."""
        offsets = {f"B{row}": ("offset", "both", {row: 1.0}) for row in self.JOINTS[self._n :]}
        return {**elements_of(self._model, constants), **offsets}

    def store(self, N: int) -> Array:
        """Return an array of zeros, shape (b, n, N), as a workspace for the regressor."""
        return np.zeros((len(self.BASE_PARAMETERS), len(self.JOINTS), N))

    def regressor(
        self, q: Array, qd: Array, qdd: Array, *, out: Array | None = None, **constants: Any
    ) -> Array:
        """Compute the regressor D of joint torques and wrenches, shape (N, n, b)."""
        D = self._standard(q, qd, qdd, constants)[..., self._columns]
        if out is not None:
            out[...] = D.transpose(2, 1, 0)
        return D

    def observation_matrix(
        self, q: Array, qd: Array, qdd: Array, *, out: Array | None = None, **constants: Any
    ) -> Array:
        """Compute the observation matrix W, shape (n*N, b), with the rows of joint 1 first."""
        D = self.regressor(q, qd, qdd, out=out, **constants)
        return D.transpose(1, 0, 2).reshape(-1, D.shape[2])

    def inverse_dynamics(
        self, q: Array, qd: Array, qdd: Array, X: Array, **constants: Any
    ) -> Array:
        """Compute joint torques and wrenches from the parameters X, shape (N, n)."""
        return np.asarray(self.regressor(q, qd, qdd, **constants) @ X)

    def base_parameters(self, standard: Any, **constants: Any) -> Array:
        """Compute the base parameters X from standard parameters.

        standard : a vector, a matrix of columns, or a mapping of name to value; offsets of sensors
            that the mapping does not have are zero.
        """
        if isinstance(standard, Mapping):
            names = self.STANDARD_PARAMETERS
            given = dict.fromkeys(names[-6 * len(self._behind) :], 0.0) | {**standard}
            standard = np.array([given[name] for name in names])
        return np.asarray(self._regrouped(constants) @ standard)

    def _standard(self, q: Array, qd: Array, qdd: Array, constants: Mapping[str, Any]) -> Array:
        """Compute the regressor of the standard parameters and sensor offsets, shape (N, n, p)."""
        model = cast(Any, BoundModel(self._model, constants))
        q, qd, qdd = (x[:, : self._n] for x in (q, qd, qdd))
        base = model.base_parameters(np.eye(len(self.STANDARD_PARAMETERS) - 6 * len(self._behind)))
        parts = [model.regressor(q, qd, qdd) @ base]
        WB, T = model.base_wrench_regressor(q, qd, qdd), model.frame_poses(q)
        for f, moved in self._behind.items():
            F, N = (WB * moved)[:, :3], (WB * moved)[:, 3:]
            if f:
                R, P = T[:, f - 1, :3, :3], T[:, f - 1, :3, 3]
                N = N - np.cross(P[:, :, None], F, axis=1)
                F, N = R.swapaxes(1, 2) @ F, R.swapaxes(1, 2) @ N
            parts += [F, N]
        D = np.concatenate(parts, axis=1)
        offsets = np.eye(D.shape[1])[:, self._n :]
        return np.concatenate([D, np.broadcast_to(offsets, (len(D), *offsets.shape))], axis=2)

    def _probed(self, constants: Mapping[str, Any]) -> Array:
        """Compute the regressor of standard parameters and sensor offsets at random states."""
        rng = np.random.default_rng(0)
        q, qd, qdd = rng.uniform(-np.pi, np.pi, (3, PROBED_STATES, self._n))
        timed = {c: rng.uniform(0.5, 2, PROBED_STATES) for c in channels_of(self._model)}
        try:
            return self._standard(q, qd, qdd, {**constants, **timed})
        except ValueError as e:  # what an emitted module of a general loop raises
            raise InputError(
                f"{self._model.NAME}: the model extended with a wrench failed its check at random states: {e}"
            ) from None

    def _regrouped(self, constants: Mapping[str, Any]) -> Array:
        """Compute the matrix K that maps standard parameters and sensor offsets to base parameters.

        K has the shape (b, p): X = K (chi, b).
        """
        A = self._probed(constants)[:, self._used]
        A = A.reshape(-1, A.shape[2])
        K = np.linalg.lstsq(A[:, self._columns], A, rcond=None)[0]
        return np.where(np.abs(K) > LEFT_OF_COLUMN, K, 0.0)


def _independent(A: Array, order: Sequence[int]) -> list[int]:
    """Find the columns of A that do not depend linearly on the columns before them in `order`."""
    Q: Array = np.zeros((len(A), 0))
    columns: list[int] = []
    for k in order:
        rest = A[:, k] - Q @ (Q.T @ A[:, k])
        rest -= Q @ (Q.T @ rest)  # twice is enough (Giraud, Langou and Rozloznik 2005)
        size = float(np.linalg.norm(rest))
        if size > LEFT_OF_COLUMN * max(float(np.linalg.norm(A[:, k])), LEFT_OF_COLUMN):
            Q, columns = np.column_stack([Q, rest / size]), [*columns, k]
    return columns
