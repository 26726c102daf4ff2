"""Public functions of identification, and lists of preparation steps, readers, methods, analyses, questions.

    STEPS      Problem -> Problem: changes of a problem before its rows are made, in this order
    READERS    Record, Signals -> States: signals.reader of a study (`runtime.core.signals.reader`)
    METHODS    Observation -> rows of a least squares -> their fit: estimate.method of a study
    CORRECTIONS  Identification -> Identification: deviations, by what the model lacks
    EXTRAS     Identification -> Part: further analyses of the records
    QUESTIONS  Identification -> Check: what the verdict asks; a part asks its own

Each call builds a Problem from model, records and study, prepares it by the steps in `STEPS` and
passes it to one function of the package. A feature is one file and one line of a list.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial, wraps
from inspect import signature
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from runtime.advisor.advice import NoAdvice
from runtime.core import identify as identification
from runtime.core.automatic import automatic_cutoff
from runtime.core.essential import Essential, essential_of
from runtime.core.identify import Correction, Extra, OnRequest
from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.linear import LinearOptions, ordinary
from runtime.core.least_squares.method import Method
from runtime.core.least_squares.wls import weighted
from runtime.core.model import GeneratedModel, channels_of, require_emitted
from runtime.core.moving_base import moved_base
from runtime.core.problem import (
    RECORD_EXPECTED,
    Note,
    Problem,
    Step,
    estimated,
    observe_rows,
    prepared,
)
from runtime.core.problem import estimate_of as estimate_by
from runtime.core.record import BASE_BIASES, BASE_IMU, WRENCH, Record
from runtime.core.rows.observation import Observation
from runtime.core.signals.reader import LOWPASS, Reader
from runtime.core.study import EstimateSettings, Signals
from runtime.counts.encoder_advice import EncoderSteps
from runtime.expected import ExpectedError
from runtime.ground.arrays import kind_of, require_kind
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.settings_errors import gone
from runtime.late import Late, Listed, PartWhen, When
from runtime.link_side import stated_sides, torques_of_links
from runtime.median import pulses_in_torques
from runtime.packets.packets import KIND as PACKETS
from runtime.packets.packets import packets_once
from runtime.payload.settings import LOADED
from runtime.reading.formats import is_measured
from runtime.reading.records import read_records
from runtime.reading.settings import RecordSettings
from runtime.rest import STATIC, poses_at_rest
from runtime.speeds import recorded_speeds
from runtime.study import Study, study_of, study_schema
from runtime.threads import alone_each, single_threaded
from runtime.unmodelled import with_lacking
from runtime.verdict import questions
from runtime.verdict.verdict import Ask, of_parts, verdict

if TYPE_CHECKING:
    from runtime.advisor.advice import Advice
    from runtime.core.cestac.result import Cestac
    from runtime.core.result import Identification
    from runtime.excitation.poses import StaticPoses
    from runtime.excitation.result import Excitation
    from runtime.loop.result import Simulation
    from runtime.loop.simulation import Simulator
    from runtime.mending.repair import Repair
    from runtime.payload.study import PayloadStudy
    from runtime.plausible.delay import Delay
    from runtime.plausible.plausibility import Plausibility
    from runtime.treatments import Ranking


def fits_biases(problem: Problem) -> bool:
    """Whether a record has a sensor on its base whose biases are fitted."""
    return any(BASE_BIASES in record.channels for record in problem.records)


STEPS: list[Step] = [
    When(
        Late("runtime.mending.corrected:corrected_model"),
        lambda p: getattr(p.settings, "robot", None) is not None,
    ),
    moved_base,
    stated_sides,
    When(
        Late("runtime.commands:commands_for_torques"),
        lambda p: any(r.origin.command for r in (*p.records, *p.unseen)),
    ),
    When(
        Late("runtime.wrench:force_sensors"),
        lambda p: any(c.startswith(WRENCH) for r in (*p.records, *p.unseen) for c in r.channels),
    ),
    torques_of_links,
    packets_once,
    pulses_in_torques,
    recorded_speeds,
    automatic_cutoff,
    poses_at_rest,
    When(Late("runtime.laws.transmitted:transmitted_torque"), lambda p: bool(channels_of(p.model))),
    When(Late("runtime.biases:fitted_biases"), fits_biases),
    When(Late("runtime.laws.scalars:fitted_scalars"), lambda p: hasattr(p.model, "FIT")),
    When(
        Late("runtime.controller.fitted:law_of_controller"),
        lambda p: any("law_v" in r.channels for r in p.records),
    ),
    When(
        Late("runtime.plausible.rests:rows_at_rest"),
        lambda p: p.settings.rows.low_speed == "auto" and bool(p.records),
    ),
]
READERS: Listed[Reader] = Listed(
    {"lowpass": LOWPASS, "counts": "runtime.counts.reader:COUNTS", "static": STATIC}
)
METHODS: Listed[Method] = Listed(
    {
        # ordinary least squares
        "ols": Method(LinearOptions, ordinary, weights=("none",)),
        # least squares weighted by joint
        "wls": Method(LinearOptions, weighted),
        # least squares among physical robots
        "feasible": "runtime.physical.feasible:METHOD",
        # robust least squares, Huber or Tukey
        "irls": "runtime.robust:METHOD",
        # instrumental variables of the simulated closed loop
        "iv": "runtime.loop.iv:METHOD",
        # torques on the regressor of the simulated motion
        "didim": "runtime.loop.didim:METHOD",
    }
)
CORRECTIONS: list[Correction] = [
    When(Late("runtime.biases:with_biases"), lambda r: fits_biases(r.problem)),
    with_lacking,
]
EXTRAS: list[Extra] = [
    PartWhen(
        Late("runtime.packets.packets:packets_told"),
        lambda r: r.problem.noted(PACKETS) is not None,
    ),
    PartWhen(Late("runtime.biases:told_biases"), lambda r: fits_biases(r.problem)),
    PartWhen(
        Late("runtime.sensor_axes:sensor_axes"),
        lambda r: any(BASE_IMU in record.channels for record in r.records),
    ),
    PartWhen(Late("runtime.plausible.known:torque_unit"), lambda r: bool(r.model.VALUES)),
    PartWhen(
        Late("runtime.controller.fitted:fitted_law"),
        lambda r: any(record.origin.by_law for record in r.records),
    ),
    PartWhen(
        Late("runtime.controller.fitted:doubt_of_gains"),
        lambda r: any("law_v" in record.channels for record in r.records),
    ),
    OnRequest(
        "plausible",
        "plausibility of the record",
        Late("runtime.plausible.plausibility:plausibility_of"),
    ),
    PartWhen(Late("runtime.laws.scalars:scalars_of_laws"), lambda r: bool(r.problem.notes)),
    PartWhen(
        Late("runtime.payload.study:load_of_study"),
        lambda r: getattr(r.study, "payload", None) is not None,
    ),
    EncoderSteps,
    PartWhen(
        Late("runtime.agreement:agreement"),
        lambda r: len(r.records) + len(r.problem.unseen) > 1,
    ),
    ExpectedError,
    OnRequest("friction", "friction", Late("runtime.friction:friction")),
    OnRequest(
        "physical",
        "physical consistency",
        Late("runtime.physical.consistency:consistency"),
        Late("runtime.physical.consistency:as_fitted"),
    ),
    OnRequest(
        "advice",
        "resolution advice",
        partial(Late("runtime.advisor.advisor:advice_of"), listed=READERS),
        NoAdvice,
    ),
    OnRequest(
        "resolution",
        "resolution study",
        partial(
            Late("runtime.core.cestac.cestac:resolution"),
            own_encoder=Late("runtime.counts.own_encoder:own_encoder"),
            loop_of=Late("runtime.loop.cestac:loop_of"),
        ),
    ),
]

RECORD_QUESTIONS: list[Ask] = [questions.determined, of_parts("record")]
QUESTIONS: list[Ask] = [
    questions.total_error,
    questions.explained_by_joint,
    of_parts("prediction"),
    questions.predicted,
    questions.signs,
    questions.certain,
    questions.separate,
    questions.conditioned,
    of_parts("values"),
]
judged = partial(verdict, on_record=RECORD_QUESTIONS, on_parameters=QUESTIONS)

Records = Record | Sequence[Record]
T = TypeVar("T")
P = ParamSpec("P")
R = TypeVar("R")

ARGUMENTS: dict[str, tuple[tuple[type, ...], str]] = {
    "unseen": ((Record, list, tuple), RECORD_EXPECTED),
    "further": ((Record, list, tuple, NoneType), RECORD_EXPECTED),
    "loaded": ((Record, list, tuple, NoneType), RECORD_EXPECTED),
    "map": ((Callable,), "a function like the built-in map"),  # type: ignore[dict-item]
    "progress": ((Callable, NoneType), "a function of two numbers"),  # type: ignore[dict-item]
    "readers": ((list, tuple, NoneType), "a list of names, such as ['counts']"),
    "provenance": ((Mapping, NoneType), "a mapping of names to data"),
    "folder": ((str, Path, NoneType), "the name of a folder"),
    "name": ((str, NoneType), "a text"),
    "physical": ((bool,), "True or False"),
    "friction": ((bool,), "True or False"),
    "ideal": ((bool,), "True or False"),
    "missing": ((bool,), "True or False"),
    "plausible": ((bool, NoneType), "True, False or None"),
}
"""Types of the further arguments of the public functions, which have one meaning in all of them."""


def entry(function: Callable[P, R]) -> Callable[P, R]:
    """Wrap a public function: its arguments are checked, and it runs with one BLAS thread.

    Raises InputError for an argument of another type than the table `ARGUMENTS` states.
    """

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        for name, given in signature(function).bind(*args, **kwargs).arguments.items():
            if name in ARGUMENTS:
                require_kind(given, ARGUMENTS[name][0], name, ARGUMENTS[name][1])
            if name == "variants" and given is not None:
                require_emitted(given, name)
            if name == "simulator" and not (given is None or hasattr(given, "run")):
                raise InputError(
                    f"simulator is {kind_of(given)}; expected a runtime.loop.simulation.Simulator"
                )
        return single_threaded(function)(*args, **kwargs)

    return checked


def require_study(study: Study | None) -> Study:
    """Check that the argument is a Study; None becomes Study(), the default settings.

    Raise InputError for anything else.
    """
    study = Study() if study is None else study
    require_kind(
        study, Study, "study", "a Study: runtime.Study(), runtime.load_study('study.yaml')"
    )
    return study


def list_records(records: Records) -> tuple[Record, ...]:
    """Return one record or several records as a tuple.

    Raise InputError for anything else.
    """
    if isinstance(records, Record):
        return (records,)
    require_kind(records, (list, tuple), "records", RECORD_EXPECTED)
    for record in records:
        require_kind(record, Record, "a record", RECORD_EXPECTED)
    return tuple(records)


def with_records(problem: Problem) -> Problem:
    """Return the problem; raise InputError if it has no record to fit."""
    if not problem.records:
        raise InputError(f"no record; expected {RECORD_EXPECTED}")
    return problem


def complete_study(study: Study) -> Study:
    """Check that method and reader of a study exist; complete the settings of the reader.

    Raise SettingsError if the method or the reader is unknown, or for a setting of another reader.
    """
    _named(METHODS, study.estimate.method, ("estimate", "method"))
    reader, signals = reader_of(study.signals), study.signals
    known = {f.name for f in fields(reader.settings)}
    for f in fields(signals):
        if f.name not in known and getattr(signals, f.name) != f.default:
            users = [name for name, one in READERS.items() if f.name in one.own_settings]
            raise SettingsError(
                f"the reader {signals.reader} does not use this key; set reader: {' or '.join(users)}, or "
                "remove this key",
                path=("signals", f.name),
            )
    return reader.settled(study)


def reader_of(signals: Signals) -> Reader:
    """Return the reader that signals.reader names; raise SettingsError if it is unknown."""
    return _named(READERS, signals.reader, ("signals", "reader"))


def _named(listed: Mapping[str, T], name: str, path: tuple[str, ...]) -> T:
    """Return the entry `name` of a list of features; SettingsError with `path` if it is unknown."""
    if name not in listed:
        *others, last = listed
        expected = f"{name!r}; expected {', '.join(others)} or {last}"
        raise SettingsError(gone(path, name) or expected, path=path)
    return listed[name]


def state_problem(
    model: GeneratedModel,
    records: Records,
    study: Study | None = None,
    unseen: Sequence[Record] = (),
    simulator: Simulator | None = None,
) -> Problem:
    """Combine model, records and study into a Problem, without any preparation step."""
    study = complete_study(require_study(study))
    methods: Mapping[str, Method] = METHODS
    if simulator is not None:
        observe = partial(Late("runtime.loop.closed_loop:observed_loop"), simulator=simulator)
        methods = {
            name: method if method.observe is None else replace(method, observe=observe)
            for name, method in METHODS.items()
        }
    return Problem(
        model,
        list_records(records),
        list_records(unseen),
        study,
        READERS[study.signals.reader],
        methods,
    )


@entry
def problem(
    model: GeneratedModel,
    records: Records,
    study: Study | None = None,
    *,
    unseen: Sequence[Record] = (),
    simulator: Simulator | None = None,
) -> Problem:
    """Build a Problem from model, records and study, and apply every preparation step.

    Parameters
    ----------
    model : GeneratedModel
        An emitted module.
    records : Record, or a sequence of them
        Joint side, SI, fitted together.
    study : Study, optional
        Settings; default: Study().
    unseen : sequence of Record, optional
        Records that the parameters predict.
    simulator : Simulator, optional
        The closed loop that iv and didim simulate; default: the loop of study.controller.

    Raises
    ------
    InputError
        A record, model or setting that a step cannot use.

    Examples
    --------
    >>> import numpy as np, runtime, symgen
    >>> model = symgen.model("emps")  # one prismatic joint
    >>> t = np.arange(0, 10, 0.001)
    >>> q, qd, qdd = np.sin(t), np.cos(t), -np.sin(t)
    >>> record = runtime.Record(t, q, tau=95 * qdd + 200 * qd + 20 * np.sign(qd))
    >>> prepared = runtime.problem(model, record)
    >>> prepared.settings.signals.lowpass.cutoff  # Hz, which the study leaves to the program
    10.0
    """
    return prepared(state_problem(model, records, study, unseen, simulator), STEPS)


def records_of(
    settings: Sequence[RecordSettings],
    model: GeneratedModel,
    study: Study,
    *,
    folder: str | Path | None = None,
) -> list[Record]:
    """Read the records of a study from their files, which are relative to `folder`."""
    require_emitted(model)
    missing = reader_of(study.signals).missing
    return read_records(settings, model, folder=folder, missing=missing)


@entry
def read_record(
    path: str | Path | RecordSettings,
    model: GeneratedModel | None = None,
    *,
    folder: str | Path = ".",
    missing: bool = False,
) -> Record:
    """Read one measured record, converted to the joint side and SI units.

    Parameters
    ----------
    path : str, Path or RecordSettings
        A measured file whose columns are called t, q1 ..., tau1 ... (SI, joint side), a study file,
        a dataset, or settings.
    model : module, optional
        Emitted model of the robot; needed if a side is "motor", because its drives convert the
        record. The number of joints is checked against it.
    folder : str or Path
        Folder to which file names are relative. File names in a study file are relative to the
        folder of that file.
    missing : bool
        Whether positions may be missing (nan or an empty field), as `signals.reader: counts`
        allows; always true for a study file with this reader.

    Raises
    ------
    InputError
        Files that cannot be read or have other content, several records, or one record that
        `resample` splits.

    Examples
    --------
    >>> from pathlib import Path
    >>> import runtime
    >>> rows = [f"{k / 100}, {k % 7}, {k % 5}" for k in range(20)]
    >>> _ = Path("run.csv").write_text("\\n".join(["t, q1, tau1", *rows]))
    >>> record = runtime.read_record("run.csv")
    >>> record.name, record.q.shape, round(record.rate)
    ('run', (20, 1), 100)
    """
    bare, folder = False, folder or "."
    if isinstance(path, RecordSettings):
        settings: tuple[RecordSettings, ...] = (path,)
    else:
        require_kind(path, (str, Path), "path", "the name of a file, or RecordSettings")
        named = Path(folder) / path
        study, folder = study_of(named if os.path.exists(named) else path)  # noqa: PTH110 (any length)
        bare = is_measured(named)
        settings = study.record
        missing = missing or reader_of(study.signals).missing
    records = read_records(settings, model, folder=folder, missing=missing)
    if len(records) != 1:
        names = ", ".join(record.name for record in records)
        raise InputError(
            f"the study has {len(records)} records (or pieces between gaps), but this function "
            f"returns only one; use read_records, which returns all: {names}"
        )
    record = records[0]
    return replace(record, origin=replace(record.origin, sides=None)) if bare else record


@entry
def observe(
    model: GeneratedModel,
    records: Records,
    study: Study | None = None,
    *,
    simulator: Simulator | None = None,
) -> Observation:
    """Build the rows Y = W X + rho of one or several records, eqs. (6) and (14) of the chapter.

    The study specifies filters, decimation and selection of rows.

    Examples
    --------
    >>> import numpy as np, runtime, symgen
    >>> model = symgen.model("emps")  # one prismatic joint
    >>> t = np.arange(0, 10, 0.001)
    >>> q, qd, qdd = np.sin(t), np.cos(t), -np.sin(t)
    >>> record = runtime.Record(t, q, tau=95 * qdd + 200 * qd + 20 * np.sign(qd))
    >>> observation = runtime.observe(model, record)
    >>> observation.names
    ('M1R', 'FV1', 'FS1', 'OFFSET1')
    >>> observation.W.shape, observation.Y.shape
    ((229, 4), (229,))
    """
    return observe_rows(problem(model, records, study, simulator=simulator))


@entry
def estimate(
    model: GeneratedModel,
    records: Records,
    study: Study | None = None,
    *,
    simulator: Simulator | None = None,
) -> Estimate:
    """Estimate all parameters from the records by the method of the study, eqs. (7) to (11).

    Parameters
    ----------
    model : GeneratedModel
        Emitted module.
    records : Record, or a sequence of them
        Joint side, SI.
    study : Study, optional
        Settings; default: Study().
    simulator : Simulator, optional
        As for `identify`.

    Returns
    -------
    Estimate
        X, standard deviations, rank and fit by joint, in SI units.

    Raises
    ------
    InputError
        Records that give no row.
    SettingsError
        A method that needs settings or data that the study or the records lack.

    Examples
    --------
    >>> import numpy as np, runtime, symgen
    >>> model = symgen.model("emps")  # one prismatic joint
    >>> t = np.arange(0, 10, 0.001)
    >>> q, qd, qdd = np.sin(t), np.cos(t), -np.sin(t)
    >>> record = runtime.Record(t, q, tau=95 * qdd + 200 * qd + 20 * np.sign(qd))
    >>> estimate = runtime.estimate(model, record)
    >>> estimate.names
    ('M1R', 'FV1', 'FS1', 'OFFSET1')
    >>> estimate.X.round(1)
    array([ 95., 200.,  20.,   0.])
    """
    whole = problem(model, records, study, simulator=simulator)
    return estimated(whole, observe_rows(whole), provenance=whole.provenance)


def estimate_of(
    observation: Observation,
    settings: EstimateSettings | None = None,
    *,
    model: GeneratedModel | None = None,
    provenance: Mapping[str, Any] | None = None,
    corrected: bool = True,
) -> Estimate:
    """Estimate the parameters of given rows Y = W X + rho by the method of `settings`.

    The default method is ols. Without `corrected`, `sigma_corrected` is nan: on a long record, its
    computation takes most of the time.
    """
    settings = settings or EstimateSettings()
    return estimate_by(
        observation, settings, METHODS, model=model, provenance=provenance, corrected=corrected
    )


@entry
def essential(
    model: GeneratedModel,
    records: Records,
    study: Study | None = None,
    *,
    simulator: Simulator | None = None,
) -> Essential:
    """Find the essential parameters: the few that explain the torques nearly as well as all.

    The method of the study is used; a method that is not linear is replaced by least squares with
    the same weights.

    Examples
    --------
    >>> import numpy as np, runtime, symgen
    >>> model = symgen.model("emps")  # one prismatic joint
    >>> t = np.arange(0, 10, 0.001)
    >>> q, qd, qdd = np.sin(t), np.cos(t), -np.sin(t)
    >>> record = runtime.Record(t, q, tau=95 * qdd + 200 * qd + 20 * np.sign(qd))
    >>> runtime.essential(model, record).names
    ('M1R', 'FV1', 'FS1')
    """
    whole = problem(model, records, study, simulator=simulator)
    return essential_of(
        whole.linear_system(observe_rows(whole)),
        whole.settings.essential,
        model=whole.model,
        provenance=whole.provenance,
    )


@entry
def identify(
    model: GeneratedModel,
    records: Records,
    study: Study | None = None,
    *,
    further: Sequence[Record] | None = None,
    loaded: Sequence[Record] | None = None,
    simulator: Simulator | None = None,
    physical: bool = False,
    friction: bool = False,
    variants: GeneratedModel | None = None,
    plausible: bool | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Identification:
    """Identify the parameters of a robot from its records and judge how far they can be trusted.

    Parameters
    ----------
    model : GeneratedModel
        An emitted module.
    records : Record, or a sequence of them
        Joint side, SI, fitted together.
    study : Study, optional
        Settings; default: Study().
    further : sequence of Record, optional
        Records that the parameters predict; default: the records of study.validate.record, read
        from their files.
    loaded : sequence of Record, optional
        Records with the load of study.payload; default: the records of study.payload.record.
    simulator : Simulator, optional
        The closed loop, which iv and didim need; default: the loop of study.controller.
    physical : bool
        Whether to check that a physical robot can have the parameters.
    friction : bool
        Whether to compute curves of friction against velocity, joint by joint.
    variants : GeneratedModel, optional
        The module of `symgen.variants`: other tables of frames and directions of gravity are tried
        on the records.
    plausible : bool, optional
        Whether to check that record, study and robot file suit each other (`runtime.plausibility`);
        default: if `variants` is given.
    provenance : mapping, optional
        Further data that make the result reproducible; names of the records, hashes and versions
        are added.

    Returns
    -------
    Identification

    Raises
    ------
    InputError
        A record, setting or requested analysis that does not suit the others.

    Examples
    --------
    >>> import numpy as np, runtime, symgen
    >>> model = symgen.model("emps")  # one prismatic joint
    >>> t = np.arange(0, 10, 0.001)
    >>> q, qd, qdd = np.sin(t), np.cos(t), -np.sin(t)
    >>> record = runtime.Record(t, q, tau=95 * qdd + 200 * qd + 20 * np.sign(qd))
    >>> result = runtime.identify(model, record)
    >>> estimate = result.estimate
    >>> dict(zip(estimate.names, estimate.X.round(1).tolist(), strict=True))
    {'M1R': 95.0, 'FV1': 200.0, 'FS1': 20.0, 'OFFSET1': 0.0}
    >>> print(result.verdict)
    The model of emps with 4 of 4 parameters leaves 0.0 % of the torques ...
    """
    asked: dict[str, Mapping[str, Any]] = {}
    if physical:
        asked["physical"] = {}
    if friction:
        asked["friction"] = {}
    if plausible or (plausible is None and variants is not None):
        asked["plausible"] = {"variants": variants}
    whole = _with_loaded(model, records, study, further, loaded, simulator)
    return identification.identify(
        whole, extras(asked), judged, corrections=CORRECTIONS, provenance=provenance
    )


@entry
def assess(
    model: GeneratedModel,
    records: Records,
    study: Study | None = None,
    *,
    encoder: Sequence[float] = (),
    variants: GeneratedModel | None = None,
    provenance: Mapping[str, Any] | None = None,
    progress: Callable[[str], None] = lambda part: None,
) -> Identification:
    """Identify a robot and make every further analysis that the data allow (`symgen report`).

    The analyses of the list `EXTRAS` are made as far as records, study and installed packages
    allow.

    encoder : steps of the encoders in use, rad or m.
    progress : called with the name of each part before the part is computed.
    """
    asked: dict[str, Mapping[str, Any]] = {
        extra.keyword: {} for extra in EXTRAS if isinstance(extra, OnRequest)
    }
    asked["plausible"] = {"variants": variants}
    asked["advice"] = {"encoder": encoder}
    whole = _with_loaded(model, records, study, None, None, None)
    progress("identification")
    return identification.identify(
        whole,
        extras(asked, attempted=True),
        judged,
        corrections=CORRECTIONS,
        provenance=provenance,
        progress=progress,
    )


@entry
def compare(
    model: GeneratedModel,
    candidates: Mapping[str, Study | tuple[Study, Records, Records]],
    *,
    variants: GeneratedModel | None = None,
) -> Ranking:
    """Identify a robot by several studies (settings), and order these by error on validation data.

    Parameters
    ----------
    model : GeneratedModel
        Emitted module.
    candidates : mapping of str to Study, or to (study, records, validation records)
        By name; a Study names its records. All validation records are of the same instants.
    variants : GeneratedModel, optional
        The module of `symgen.variants`: the plausibility of the best treatment is then judged.

    Raises
    ------
    InputError
        There is no candidate; a candidate has no validation records, or others than the first; or
        no candidate can be identified.

    Examples
    --------
    >>> import numpy as np, runtime, symgen
    >>> model = symgen.model("emps")  # one prismatic joint
    >>> t = np.arange(0, 10, 0.001)
    >>> q, qd, qdd = np.sin(t), np.cos(t), -np.sin(t)
    >>> record = runtime.Record(t, q, tau=95 * qdd + 200 * qd + 20 * np.sign(qd))
    >>> studies = {name: runtime.Study(estimate={"method": name}) for name in ("ols", "irls")}
    >>> given = {name: (study, record, record) for name, study in studies.items()}
    >>> sorted(runtime.compare(model, given).results)
    ['irls', 'ols']
    """
    from runtime import treatments as comparing

    require_kind(candidates, Mapping, "candidates", "a mapping of names to studies")
    problems = {name: prepared(_candidate(model, one), STEPS) for name, one in candidates.items()}
    of_the_best = []
    if variants is not None:
        plausible = Late("runtime.plausible.plausibility:plausibility_of")
        of_the_best.append(partial(plausible, variants=variants))
    return comparing.compare(problems, extras({}), judged, of_the_best)


@entry
def cestac(
    model: GeneratedModel,
    records: Records,
    study: Study | None = None,
    *,
    simulator: Simulator | None = None,
    map: Callable[..., Iterable[Any]] = map,
    **options: Any,
) -> Cestac:
    """Compute how coarser encoders and torque sensors change the estimate, eqs. (15) to (22), (28).

    map : like the built-in map; makes the runs, in processes
        (`runtime.parallel.processes.processes`) or on a Dask cluster (docs/many_runs.md).
    options : columns, progress, checkpoint, provenance, as of `runtime.core.cestac.cestac.cestac`.

    Examples
    --------
    >>> import numpy as np, runtime, symgen
    >>> model = symgen.model("emps")  # one prismatic joint
    >>> t = np.arange(0, 10, 0.001)
    >>> q, qd, qdd = np.sin(t), np.cos(t), -np.sin(t)
    >>> record = runtime.Record(t, q, tau=95 * qdd + 200 * qd + 20 * np.sign(qd))
    >>> study = runtime.Study(cestac={"delta": [0.0001, 0.002]})  # m
    >>> result = runtime.cestac(model, record, study)
    >>> [level.verdict for level in result.levels]
    ['unbiased', 'biased']
    """
    from runtime.core.cestac import cestac as resolution

    return resolution.cestac(
        problem(model, records, study, simulator=simulator),
        own_encoder=Late("runtime.counts.own_encoder:own_encoder"),
        loop_of=partial(Late("runtime.loop.cestac:loop_of"), simulator=simulator),
        map=alone_each(map),
        **options,
    )


@entry
def advise(
    model: GeneratedModel,
    records: Records,
    study: Study | None = None,
    *,
    readers: Sequence[str] | None = None,
    **options: Any,
) -> Advice:
    """Predict the coarsest encoders that change the estimate by less than 1 % and by less than 5 %.

    readers : names of the readers for which real encoders are judged; default: all that read
        encoders if study.cestac.rounding is phase, otherwise none.
    options : columns, asked, encoders, confirm, progress, provenance, as of
        `runtime.advisor.advisor.advise`.

    Examples
    --------
    >>> import numpy as np, runtime, symgen
    >>> model = symgen.model("emps")  # one prismatic joint
    >>> t = np.arange(0, 10, 0.001)
    >>> q, qd, qdd = np.sin(t), np.cos(t), -np.sin(t)
    >>> record = runtime.Record(t, q, tau=95 * qdd + 200 * qd + 20 * np.sign(qd))
    >>> for limit in runtime.advise(model, record).encoders[0].limits:
    ...     print(f"{limit.parameter} changes by {limit.percent:g} % at {limit.delta:.2g} m")
    M1R changes by 1 % at 0.00044 m
    M1R changes by 5 % at 0.001 m
    """
    from runtime.advisor import advisor

    whole = problem(model, records, study)
    suited = {name: reader for name, reader in READERS.items() if reader.reads_encoders}
    for name in readers or ():
        require_kind(name, str, "a reader", "its name, such as 'counts'")
    chosen = {name: _named(suited, name, ("signals", "reader")) for name in readers or ()}
    if not chosen:
        chosen = advisor.readers_of_law(whole, READERS)
    return advisor.advise(whole, readers=chosen, **options)


@entry
def plausibility(
    model: GeneratedModel,
    records: Records,
    study: Study | None = None,
    *,
    variants: GeneratedModel | None = None,
) -> Plausibility:
    """Check whether record, study and robot file agree with each other.

    Also search for single changes of study or robot file that explain the record better.

    Examples
    --------
    >>> import numpy as np, runtime, symgen
    >>> model = symgen.model("emps")  # one prismatic joint
    >>> t = np.arange(0, 10, 0.001)
    >>> q, qd, qdd = np.sin(t), np.cos(t), -np.sin(t)
    >>> record = runtime.Record(t, q, tau=95 * qdd + 200 * qd + 20 * np.sign(qd))
    >>> reversed = runtime.Record(t, q, -record.tau)
    >>> result = runtime.plausibility(model, reversed)
    >>> [trial.cause.says for trial in result.named]
    ['the torque of joint 1 has the wrong sign', 'the position of joint 1 has the wrong sign']
    """
    from runtime.plausible import plausibility as checks

    whole = with_records(problem(model, records, study))
    return checks.plausibility(whole, variants=variants)


@entry
def delay(
    model: GeneratedModel, record: Record, study: Study | None = None, **options: Any
) -> Delay:
    """Estimate the time shift between positions and torques of a record, joint by joint.

    options : longest, the largest delay that is searched, s.

    Examples
    --------
    >>> import numpy as np, runtime, symgen
    >>> model, t = symgen.model("emps"), np.arange(0, 10, 0.001)
    >>> q, qd = np.sin(t) + np.sin(3 * t) / 3, np.cos(t) + np.cos(3 * t)
    >>> qdd = -np.sin(t) - 3 * np.sin(3 * t)
    >>> tau = np.roll(95 * qdd + 200 * qd + 20 * np.sign(qd), 8)  # 8 ms late
    >>> round(runtime.delay(model, runtime.Record(t, q, tau)).common, 3)
    0.008
    """
    from runtime.plausible import delay as delays

    return delays.delay(with_records(problem(model, record, study)), **options)


@entry
def payload(
    model: GeneratedModel, records: Records, study: Study, *, loaded: Sequence[Record] | None = None
) -> PayloadStudy:
    """Identify the load on the robot (study.payload) from records with and without this load.

    loaded : records with the load; default: the records of study.payload.record.
    """
    from runtime.payload import study as loads

    whole = _with_loaded(model, records, study, (), loaded, None)
    note = whole.noted(LOADED)
    return loads.payload_study(whole, () if note is None else note.result)


@entry
def excite(
    model: GeneratedModel,
    records: Records = (),
    study: Study | None = None,
    *,
    map: Callable[..., Iterable[Any]] = map,
    progress: Callable[[int, int], None] | None = None,
) -> Excitation:
    """Search for an exciting motion within the robot's limits, with the best criterion of the study.

    The best motion over all starts of the search is returned. Without records, the values of the
    robot file serve as parameters.

    Examples
    --------
    >>> import runtime, symgen
    >>> part = {"family": "fourier", "period": 5, "harmonics": 3}
    >>> study = runtime.Study(excitation={"parts": [part], "starts": 1, "iterations": 5, "rate": 200})
    >>> motion = runtime.excite(symgen.model("planar_2r"), study=study)
    >>> t, q, qd, qdd, tau = motion.sampled()
    >>> q.shape
    (1001, 2)
    """
    from runtime.excitation import search

    whole = problem(model, records, study)
    return search.excite(whole, map=alone_each(map), progress=progress)


@entry
def static_poses(
    model: GeneratedModel, records: Records = (), study: Study | None = None
) -> StaticPoses:
    """Search for static poses that, with recorded poses, determine the gravity parameters best.

    study.excitation.poses is the number of new poses, default 20. All poses respect the limits of
    q.

    Examples
    --------
    >>> import runtime, symgen
    >>> study = runtime.Study(excitation={"poses": 3})
    >>> result = runtime.static_poses(symgen.model("planar_2r"), study=study)
    >>> result.poses.shape
    (3, 2)
    >>> list(result.sigma)
    ['MX1R', 'MY1', 'OFFSET1', 'MX2', 'MY2', 'OFFSET2']
    """
    from runtime.excitation import poses

    return poses.static_poses(problem(model, records, study))


@entry
def repair(
    model: GeneratedModel,
    records: Records,
    study: Study | None = None,
    *,
    variants: GeneratedModel | None = None,
    further: Sequence[Record] | None = None,
    folder: str | Path | None = None,
) -> Repair:
    """Search for the lines of a study that are wrong, several at once, and write the mended study.

    The lines are searched on some blocks of the records, and judged on the other blocks and on the
    validation records. All changes are kept, or none.

    Parameters
    ----------
    model : GeneratedModel
        An emitted module.
    records : Record, or a sequence of them
        Joint side, SI, as the study reads them.
    study : Study, optional
        Settings; default: Study().
    variants : GeneratedModel, optional
        The module of `symgen.variants`: gravity and the table of frames are corrected too.
    further : sequence of Record, optional
        Validation records; default: the records of study.validate.record.
    folder : str or Path, optional
        Folder to which file names of the study are relative.

    Returns
    -------
    Repair
        Changes with their errors, the new study and its records. If `study.robot` is changed, the
        model of the new study is symgen.model(symgen.corrected(robot, study)).

    Raises
    ------
    InputError
        Broken records: gaps, jumps, cut torques, two publishers.

    Examples
    --------
    >>> import numpy as np, runtime, symgen
    >>> model = symgen.model("emps")  # one prismatic joint
    >>> t = np.arange(0, 10, 0.001)
    >>> q, qd, qdd = np.sin(t), np.cos(t), -np.sin(t)
    >>> record = runtime.Record(t, q, tau=95 * qdd + 200 * qd + 20 * np.sign(qd))
    >>> reversed = runtime.Record(t, q, -record.tau)
    >>> result = runtime.repair(model, reversed)
    >>> [change.says for change in result.changes]
    ['the torque of joint 1 has the wrong sign']
    >>> result.study.record[0].scale.tau
    -1.0
    """
    from runtime.mending import repair as repairing

    study = require_study(study)
    if further is None:
        further = records_of(study.validate.record, model, study, folder=folder)
    whole = with_records(problem(model, records, study, unseen=further))
    stated = study if study.record else replace(study, record=(RecordSettings(),))
    given = list_records(records)
    return repairing.repair(whole, stated, records=given, variants=variants, folder=folder)


def extras(asked: Mapping[str, Mapping[str, Any]], attempted: bool = False) -> list[Extra]:
    """Select the analyses that follow an identification, with the options that the user requested.

    An analysis on request that is not in `asked` is replaced by its substitute, if it has one.
    """
    chosen: list[Extra] = []
    for extra in EXTRAS:
        if not isinstance(extra, OnRequest):
            chosen.append(extra)
        elif extra.keyword in asked:
            chosen.append(replace(extra, options=asked[extra.keyword], attempted=attempted))
        elif extra.otherwise is not None:
            chosen.append(extra.otherwise)
    return chosen


@entry
def simulate(
    model: GeneratedModel,
    study: Study,
    *,
    folder: str | Path | None = None,
    ideal: bool = False,
    name: str | None = None,
) -> Simulation:
    """Simulate the control loop of study.controller along its reference motion.

    To run one loop many times, use `runtime.loop.simulation.Simulator`.

    Parameters
    ----------
    model : GeneratedModel
        With values of its standard parameters, or with all of them in `values` of the controller.
    study : Study
        With a section `controller`.
    folder : str or Path, optional
        Folder to which file names of the study are relative; default: the current folder.
    ideal : bool
        Whether to simulate without noise and without steps of encoder and converter.
    name : str, optional
        Name of the simulated record; the default name says that nothing was measured.

    Raises
    ------
    InputError
        No section `controller`, or a reference outside the limits of the robot.
    SimulationError
        An inertia matrix that is not positive definite, or a loop that is not stable.

    Examples
    --------
    >>> import runtime, symgen
    >>> loop = {
    ...     "law": {"kind": "pid", "kp": [4000, 400], "kd": [200, 20]},
    ...     "reference": {"points": {"duration": 2}},
    ... }
    >>> study = runtime.Study(controller=loop)
    >>> result = runtime.simulate(symgen.model("planar_2r"), study, ideal=True)
    >>> bool(abs(result.q - result.q_r).max() < 0.03)  # rad
    True
    """
    from runtime.loop import simulation

    require_emitted(model)
    study = require_study(study)
    if study.controller is None:
        raise InputError(
            "the study has no section `controller`; add this section with law, rate and reference of the closed loop"
        )
    records: Sequence[Record] = ()
    if study.controller.reference.record is not None:
        records = records_of(study.record, model, study, folder=folder)
    return simulation.simulate(
        model, study.controller, records=records, folder=folder, ideal=ideal, name=name
    )


def json_schema(of: str) -> dict[str, Any]:
    """Return the JSON Schema of study files, of estimate.json or of cestac.json.

    of : "study", "estimate" or "cestac".
    """
    from runtime.documents.estimates import result_schema

    if of != "study":
        return result_schema(of)
    schema = study_schema()
    sections = schema["$defs"]
    sections["EstimateSettings"]["properties"]["method"]["enum"] = [*METHODS]
    sections["Signals"]["properties"]["reader"]["enum"] = [*READERS]
    return schema


def _with_loaded(
    model: GeneratedModel,
    records: Records,
    study: Study | None,
    unseen: Sequence[Record] | None,
    loaded: Sequence[Record] | None,
    simulator: Simulator | None,
) -> Problem:
    """Prepare the problem of a study, including the records with a load (study.payload).

    The same steps prepare the records with the load, which are stored in a note of the problem.
    """
    study = require_study(study)
    if unseen is None:
        unseen = records_of(study.validate.record, model, study)
    if loaded is None:
        loaded = () if study.payload is None else records_of(study.payload.record, model, study)
    unseen = list_records(unseen)
    count = len(unseen)
    whole = problem(
        model, records, study, unseen=(*unseen, *list_records(loaded)), simulator=simulator
    )
    note = Note(LOADED, "", result=whole.unseen[count:])
    return whole.changed(note, unseen=whole.unseen[:count])


def _candidate(model: GeneratedModel, candidate: Study | tuple[Study, Records, Records]) -> Problem:
    """Build the Problem of one of the studies that are compared, without any preparation step."""
    if isinstance(candidate, Study):
        fitted = records_of(candidate.record, model, candidate)
        predicted = records_of(candidate.validate.record, model, candidate)
        return state_problem(model, fitted, candidate, predicted)
    if not (isinstance(candidate, tuple) and len(candidate) == 3):
        raise InputError(
            f"a candidate is {kind_of(candidate)}; expected a Study, or (study, records, validation records)"
        )
    study, records, unseen = candidate
    return state_problem(model, records, study, list_records(unseen))


__all__ = [
    "CORRECTIONS",
    "EXTRAS",
    "METHODS",
    "QUESTIONS",
    "READERS",
    "RECORD_QUESTIONS",
    "STEPS",
    "InputError",
    "advise",
    "assess",
    "cestac",
    "compare",
    "delay",
    "essential",
    "estimate",
    "estimate_of",
    "excite",
    "identify",
    "observe",
    "payload",
    "plausibility",
    "problem",
    "repair",
    "simulate",
    "static_poses",
]
