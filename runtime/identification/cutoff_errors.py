"""What another cut-off of the low-pass predicts: a check on `signals.lowpass.cutoff: auto`, shown
beside it.

X_c, the parameters of the first half of the records filtered at c, predicts the second half
filtered at every k of the same cut-offs, so that none wins by torques that are smoother:

    e_c = (prod_k e_ck)^(1/K),   e_ck = 100 ||Y_k - W_k X_c|| / ||Y_k||
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from runtime.errors import InputError
from runtime.estimators.method import linear_companion
from runtime.identification.validation import prediction_errors
from runtime.limits import LIMIT
from runtime.loop.methods import estimate_of
from runtime.model.generated import GeneratedModel
from runtime.rows.observation import halves
from runtime.rows.observe import observe
from runtime.rows.prepared import Prepared
from runtime.settings.study import Study

BETTER = "set signals.lowpass.cutoff"


def cutoff_errors(
    model: GeneratedModel, records: Sequence[Prepared], study: Study
) -> dict[float, float]:
    """e_c, %, by cut-off, Hz: that of the study and LIMIT.CUTOFFS_TRIED times it, as far as the
    rates allow; empty where a half of the records does not determine the parameters at that of the
    study.
    """
    low = study.signals.lowpass
    assert low is not None
    highest = LIMIT.HIGHEST_CUTOFF * min(own.record.rate for own in records)
    fits, seconds = {}, []
    for hertz in (float(f"{factor * low.hertz:.2g}") for factor in LIMIT.CUTOFFS_TRIED):
        if hertz > max(highest, low.hertz):
            continue
        signals = replace(study.signals, lowpass=replace(low, cutoff=hertz))
        own = replace(study, signals=signals)
        try:
            rows = observe(model, [one.by(own) for one in records], own)
            first, second = (rows.between(*window) for window in halves(*rows.span))
            fit = estimate_of(first, linear_companion(study.estimate), model=model)
        except InputError:
            continue
        if fit.status == "ok":
            fits[hertz] = fit
            seconds.append(second)
    return {
        hertz: float(np.exp(np.mean([np.log(prediction_errors(rows, fit)[0]) for rows in seconds])))
        for hertz, fit in fits.items()
    }


def cutoff_text(errors: Mapping[float, float], hertz: float) -> str:
    """The errors in a sentence, and what to set where another cut-off predicts clearly better;
    hertz : that of the study.
    """
    own = errors.get(hertz)
    if own is None or len(errors) < 2:
        return ""
    best = min(errors, key=lambda one: errors[one])
    listed = ", ".join(f"{one:g} Hz {error:.3g} %" for one, error in errors.items())
    clear = own > LIMIT.CUTOFF_GAIN * errors[best] and own - errors[best] > LIMIT.LEAST_CUTOFF_GAIN
    return f" Unseen half by cut-off: {listed}" + (
        f"; {BETTER}: {best:g} and compare." if clear else "."
    )
