"""Encoder resolution: how far do parameters move when positions are rounded, and how coarse may an
encoder be?
"""

import matplotlib.pyplot as plt
import numpy as np

import runtime
import symgen

model = symgen.model("planar_2r")
t = np.arange(0, 20, 0.002)
w, a = (
    np.array([[0.9, 1.3], [2.3, 3.1], [4.7, 6.1]]),
    np.array([[0.8, 0.6], [0.3, 0.4], [0.15, 0.2]]),
)
phase = t[:, None, None] * w
q = (a * np.sin(phase)).sum(axis=1)
qd, qdd = (a * w * np.cos(phase)).sum(axis=1), (-a * w**2 * np.sin(phase)).sum(axis=1)
tau = model.inverse_dynamics(q, qd, qdd, model.base_parameters(model.VALUES))
record = runtime.Record(t, q, tau + np.random.default_rng(0).normal(0, 0.2, q.shape))

steps = ["2*pi/10000", "2*pi/1000", "2*pi/200"]
study = runtime.Study(
    signals={"lowpass": {"cutoff": 20}, "median": 1}, cestac={"delta": steps, "runs": 20}
)
print(runtime.cestac(model, record, study).to_table())
everyone = runtime.advise(model, record, study, encoders=["all"], confirm=False).encoders[0]
for limit in everyone.limits:
    print(f"{limit.percent:g} % is reached by {limit.parameter} at steps of {limit.delta:.2g} rad")

deltas = np.geomspace(1e-5, 3e-3, 7)
study = runtime.Study(
    signals={"lowpass": {"cutoff": 20}, "median": 1}, cestac={"delta": list(deltas), "runs": 10}
)
levels = runtime.cestac(model, record, study).levels
plt.figure()
plt.loglog(deltas, [level.e.max() for level in levels], "o-")
plt.axhline(1, ls=":", color="0.4", label="1 %: unbiased below")
plt.axhline(5, ls="--", color="0.4", label="5 %: biased above")
plt.legend()
plt.xlabel("encoder step, rad")
plt.ylabel("largest change of a parameter, %")
plt.savefig("encoder_resolution.png")
