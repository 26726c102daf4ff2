"""symgen, from the record: its own filters with the cut-off that it is given, and the parameters
that it says stand for the robot.
"""

import numpy as np

import runtime
import symgen


def given(job):
    pieces = (np.split(x, np.cumsum(job.lengths)[:-1]) for x in (job.t, job.raw_q, job.raw_tau))
    study = runtime.Study(
        signals={"median": 1, "lowpass": {"cutoff": job.cutoff}},
        rows={"low_speed": job.slow.tolist()},
        estimate={"method": "wls", "weights": "joint"},
    )
    return symgen.model(job.robot), [runtime.Record(*p) for p in zip(*pieces, strict=True)], study


def answer(model, found):
    X = np.zeros(len(model.BASE_PARAMETERS))
    X[[model.BASE_PARAMETERS.index(name) for name in found.names]] = found.X
    values = zip(found.names, zip(found.X, found.sigma_corrected, strict=True), strict=True)
    return lambda q, qd, qdd: model.inverse_dynamics(q, qd, qdd, X), dict(values)


def fit(job):
    return identified(job, *given(job))


def identified(job, model, records, study):
    """What stands for the robot; causes and doubts are printed."""
    variants = symgen.variants(job.robot) if job.final else None
    result = runtime.identify(model, records, study, variants=variants)
    plausibility = result.part("plausibility")
    if plausibility:
        for trial in plausibility.named:
            print(trial.cause.says)
        for check in plausibility.checks():
            if check.state in ("no", "doubtful"):
                print(check.finding)
    return answer(model, result.model_estimate)


def least_squares(job):
    """All parameters, nothing but the record behind them."""
    model, records, study = given(job)
    return answer(model, runtime.estimate(model, records, study))
