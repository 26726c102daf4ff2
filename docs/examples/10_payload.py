"""A load in the gripper: its mass and centre of mass from records with and without it."""

import numpy as np

import runtime
import symgen
from runtime.payload.load import payload

model = symgen.model("planar_2r")
t = np.arange(0, 20, 0.002)
w, a = (
    np.array([[0.9, 1.3], [2.3, 3.1], [4.7, 6.1]]),
    np.array([[0.8, 0.6], [0.3, 0.4], [0.15, 0.2]]),
)
phase = t[:, None, None] * w
q = (a * np.sin(phase)).sum(axis=1)
qd, qdd = (a * w * np.cos(phase)).sum(axis=1), (-a * w**2 * np.sin(phase)).sum(axis=1)
study = runtime.Study(signals={"lowpass": {"cutoff": 20}}, payload={})


def observed(standard: dict[str, float], seed: int) -> runtime.Observation:
    """Rows of a record of the arm with these parameters."""
    tau = model.inverse_dynamics(q, qd, qdd, model.base_parameters(standard))
    return runtime.observe(
        model,
        runtime.Record(t, q, tau + np.random.default_rng(seed).normal(0, 0.2, q.shape)),
        study,
    )


values = dict(model.VALUES)
load = {"M2": 1.5, "MX2": 1.5 * 0.4, "ZZ2": 1.5 * 0.4**2}  # 1.5 kg at 0.4 m
loaded = {name: x + load.get(name, 0.0) for name, x in values.items()}
found = payload(model, [observed(values, 1)], [observed(loaded, 2)], study.payload)
for name, x, sigma in zip(found.names, found.value, found.sigma, strict=True):
    print(f"{name} of the load: {x:.3f} +- {sigma:.3f}")
