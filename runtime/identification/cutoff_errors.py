"""What another cut-off of the low-pass predicts, or, of positions read as counts, the low-pass: a
check on `signals.lowpass.cutoff: auto` and on `signals.reader: counts`, shown beside them.

X_c, the parameters of the first half of the records by the study c, predicts the second half by
every study k, so that none wins by torques that are smoother; of counts and low-pass every fifth is
predicted by all others:

    e_c = (prod_k e_ck)^(1/K),   e_ck = 100 ||Y_k - W_k X_c|| / ||Y_k||, over the fifths too

Rows that counts leave out, since they tell no direction of dry friction, are among those of the
low-pass: parameters that the others do not tell apart show there.
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
from runtime.rows.observe import observe
from runtime.rows.prepared import Prepared, resolved
from runtime.settings.study import Lowpass, Study

BETTER = "set signals"


def other_studies(records: Sequence[Prepared], study: Study) -> dict[str, Study]:
    """Studies of the records by label, that of the study among them: LIMIT.CUTOFFS_TRIED times its
    cut-off, as far as the rates allow; of counts the low-pass with the cut-off that suits it.
    """
    signals, low = study.signals, study.signals.lowpass
    if signals.reader == "counts":
        plain = replace(signals, reader="lowpass", step=None, lines="detected", lowpass=Lowpass())
        return {"low-pass": resolved(replace(study, signals=plain), records)[0], "counts": study}
    assert low is not None
    highest = max(LIMIT.HIGHEST_CUTOFF * min(own.record.rate for own in records), low.hertz)
    tried = [float(f"{factor * low.hertz:.2g}") for factor in LIMIT.CUTOFFS_TRIED]
    filters = [replace(low, cutoff=hertz) for hertz in tried if hertz <= highest]
    others = [replace(study, signals=replace(signals, lowpass=own)) for own in filters]
    return {f"{own.hertz:g}": other for own, other in zip(filters, others, strict=True)}


def unseen_errors(
    model: GeneratedModel, records: Sequence[Prepared], studies: Mapping[str, Study]
) -> dict[str, float]:
    """e_c, %, by label, without studies by which a part of the records does not determine the
    parameters.
    """
    count, tested = (LIMIT.HELD_OUT_PARTS, 0) if "counts" in studies else (2, 1)
    fits, parts = {}, []
    for label, own in studies.items():
        try:
            rows = observe(model, [one.by(own) for one in records], own)
            number, settings = rows.equal_parts(count), linear_companion(own.estimate)
            rest = [rows.where(number != p) for p in range(tested, count)]
            found = [estimate_of(each, settings, model=model) for each in rest]
        except InputError:
            continue
        if all(fit.status == "ok" for fit in found):
            fits[label] = found
            parts.append([rows.where(number == p) for p in range(tested, count)])
    errors = {
        label: [
            prediction_errors(*pair)[0] for each in parts for pair in zip(each, own, strict=True)
        ]
        for label, own in fits.items()
    }
    return {label: float(np.exp(np.mean(np.log(own)))) for label, own in errors.items()}


def errors_text(errors: Mapping[str, float], label: str) -> str:
    """The errors in a sentence, and what to set where another study than that of the label predicts
    clearly better.
    """
    own = errors.get(label)
    if own is None or len(errors) < 2:
        return ""
    best = min(errors, key=lambda one: errors[one])
    by, unit, better = (
        ("fifths by reader", "", "reader: lowpass")
        if label == "counts"
        else ("half by cut-off", " Hz", f"lowpass.cutoff: {best}")
    )
    listed = ", ".join(f"{one}{unit} {error:.3g} %" for one, error in errors.items())
    clear = own > LIMIT.CUTOFF_GAIN * errors[best] and own - errors[best] > LIMIT.LEAST_CUTOFF_GAIN
    return f" Unseen {by}: {listed}" + (f"; {BETTER}.{better} and compare." if clear else ".")
