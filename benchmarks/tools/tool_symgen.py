"""symgen, from the record: its own filters with the cut-off that it is given, and the parameters
that it says stand for the robot.
"""

import numpy as np

import runtime
import symgen


def fit(job, chosen="model_estimate"):
    model = symgen.model(job.robot)
    ends = np.cumsum([0, *job.lengths])
    records = [
        runtime.Record(job.t[a:b], job.raw_q[a:b], job.raw_tau[a:b])
        for a, b in zip(ends, ends[1:], strict=False)
    ]
    study = runtime.Study(
        signals={"median": 1, "lowpass": {"cutoff": job.cutoff}},
        rows={"low_speed": job.slow.tolist()},
        estimate={"method": "wls", "weights": "joint"},
    )
    variants = symgen.variants(job.robot) if job.final else None
    result = runtime.identify(model, records, study, variants=variants)
    if result.plausibility:
        for check in result.plausibility.checks:
            if check.state != "yes":
                print(f"{check.finding}. {check.remedy}")
    found = getattr(result, chosen)
    X = np.zeros(len(model.BASE_PARAMETERS))
    X[[model.BASE_PARAMETERS.index(name) for name in found.names]] = found.X

    def predict(q, qd, qdd):
        return model.inverse_dynamics(q, qd, qdd, X)

    return predict, dict(zip(found.names, zip(found.X, found.sigma_corrected)))


def least_squares(job):
    """All parameters, nothing but the record behind them."""
    return fit(job, "estimate")
