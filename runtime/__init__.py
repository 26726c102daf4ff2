"""Identify the parameters of a robot from measured records, and judge how far to trust them.

    model = runtime.load_model("tx40")            # an emitted module, by name or path
    record = runtime.Record(t, q, tau)            # joint side, SI, shapes (N,), (N, n), (N, n)
    result = runtime.identify(model, record)      # every function: model, record(s), study
    result.estimate, result.checklist
    runtime.report(result, "out")                 # the page and files of `symgen identify -o out`

Names are imported when they are first used, so that `import runtime` is fast. NumPy, SciPy and
pydantic are enough for Record, resample, observe, estimate, essential and cestac. Other packages
are imported when they are needed:

    ruamel.yaml           study files                     clarabel   identify, method feasible
    casadi                simulate, excite, iv, didim     pint       units that no table holds
    matplotlib, jinja2    report                          pooch      datasets
    threadpoolctl         one BLAS thread, which is faster
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from runtime.advisor.advice import Advice
    from runtime.compose import (
        advise,
        cestac,
        compare,
        delay,
        essential,
        estimate,
        excite,
        identify,
        observe,
        plausibility,
        problem,
        read_record,
        repair,
        simulate,
        static_poses,
    )
    from runtime.core.cestac.result import Cestac
    from runtime.core.least_squares.estimate import Estimate
    from runtime.core.model import load_model
    from runtime.core.problem import Problem
    from runtime.core.record import Record
    from runtime.core.result import Identification
    from runtime.core.rows.observation import Observation
    from runtime.each import identify_each
    from runtime.files import report
    from runtime.ground.errors import InputError
    from runtime.reading.resampling import resample
    from runtime.study import Study, load_study

__all__ = [
    "Advice",
    "Cestac",
    "Estimate",
    "Identification",
    "InputError",
    "Observation",
    "Problem",
    "Record",
    "Study",
    "advise",
    "cestac",
    "compare",
    "delay",
    "essential",
    "estimate",
    "excite",
    "identify",
    "identify_each",
    "load_model",
    "load_study",
    "observe",
    "plausibility",
    "problem",
    "read_record",
    "repair",
    "report",
    "resample",
    "simulate",
    "static_poses",
]

_MODULES = {
    "runtime.compose": (
        "advise",
        "cestac",
        "compare",
        "delay",
        "essential",
        "estimate",
        "excite",
        "identify",
        "observe",
        "plausibility",
        "problem",
        "read_record",
        "repair",
        "simulate",
        "static_poses",
    ),
    "runtime.core.problem": ("Problem",),
    "runtime.ground.errors": ("InputError",),
    "runtime.core.least_squares.estimate": ("Estimate",),
    "runtime.core.result": ("Identification",),
    "runtime.core.model": ("load_model",),
    "runtime.core.record": ("Record",),
    "runtime.reading.resampling": ("resample",),
    "runtime.each": ("identify_each",),
    "runtime.files": ("report",),
    "runtime.advisor.advice": ("Advice",),
    "runtime.core.cestac.result": ("Cestac",),
    "runtime.core.rows.observation": ("Observation",),
    "runtime.study": ("Study", "load_study"),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import a public name from the module that defines it, when it is first used (PEP 562)."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_MODULE_OF[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
