"""symgen, from the record: its own filters with the cut-off that it is given, and the parameters
that it says stand for the robot.
"""

import numpy as np

import runtime
import symgen


def fit(job, chosen="model_estimate"):
    model = symgen.model(job.robot)
    ends = np.cumsum(job.lengths)[:-1]
    pieces = (np.split(x, ends) for x in (job.t, job.raw_q, job.raw_tau))
    records = [runtime.Record(*piece) for piece in zip(*pieces, strict=True)]
    study = runtime.Study(
        signals={"median": 1, "lowpass": {"cutoff": job.cutoff}},
        rows={"low_speed": job.slow.tolist()},
        estimate={"method": "wls", "weights": "joint"},
    )
    variants = symgen.variants(job.robot) if job.final else None
    result = runtime.identify(model, records, study, variants=variants)
    if result.plausibility:
        for trial in result.plausibility.named:
            print(trial.alternative.cause)
        for check in result.plausibility.checks:
            if check.state in ("no", "doubtful"):
                print(check.finding)
    found = getattr(result, chosen)
    X = np.zeros(len(model.BASE_PARAMETERS))
    X[[model.BASE_PARAMETERS.index(name) for name in found.names]] = found.X

    def predict(q, qd, qdd):
        return model.inverse_dynamics(q, qd, qdd, X)

    return predict, {
        name: (found[name], s) for name, s in zip(found.names, found.sigma_corrected, strict=True)
    }


def least_squares(job):
    """All parameters, nothing but the record behind them."""
    return fit(job, "estimate")
