"""Encoder resolution: how far do parameters move when positions are rounded, and how coarse may an encoder be?"""

import tempfile
from pathlib import Path

import numpy as np

from runtime import Record, load_model
from runtime.settings.study import study_from_mapping
from runtime.resolution.advisor import advise
from runtime.resolution.cestac import cestac
from symgen import generate_module, load_robot

module = Path(tempfile.mkdtemp()) / "planar_2r.py"
module.write_text(generate_module(load_robot("planar_2r")))
model = load_model(module)

t = np.arange(0, 20, 0.002)
w, a = np.array([[0.9, 1.3], [2.3, 3.1], [4.7, 6.1]]), np.array([[0.8, 0.6], [0.3, 0.4], [0.15, 0.2]])
phase = t[:, None, None] * w
q = (a * np.sin(phase)).sum(axis=1)
qd, qdd = (a * w * np.cos(phase)).sum(axis=1), (-a * w**2 * np.sin(phase)).sum(axis=1)
tau = model.inverse_dynamics(q, qd, qdd, model.base_parameters(model.VALUES))
record = Record(t, q, tau + np.random.default_rng(0).normal(0, 0.2, q.shape), rate=500.0)

study = study_from_mapping(
    {
        "signals": {"lowpass": {"cutoff": 20}, "median": 1},
        "cestac": {"delta": ["2*pi/10000", "2*pi/1000", "2*pi/200"], "runs": 20},
    }
)
print(cestac(model, record, study).to_table())
everyone = advise(model, record, study, encoders=["all"], confirm=False).encoders[0]
for limit in everyone.limits:
    print(f"{limit.percent:g} % is reached by {limit.parameter} at steps of {limit.delta:.2g} rad")
