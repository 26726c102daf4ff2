"""Identification of arrays: no file, no command, only positions and torques in memory."""

import numpy as np

import runtime
import symgen

model = symgen.model("planar_2r")  # or a robot file: arm.yaml, arm.urdf

# A measurement: here computed from the values of the robot file, with torque noise.
t = np.arange(0, 20, 0.002)
w, a = (
    np.array([[0.9, 1.3], [2.3, 3.1], [4.7, 6.1]]),
    np.array([[0.8, 0.6], [0.3, 0.4], [0.15, 0.2]]),
)
phase = t[:, None, None] * w
q = (a * np.sin(phase)).sum(axis=1)
qd, qdd = (a * w * np.cos(phase)).sum(axis=1), (-a * w**2 * np.sin(phase)).sum(axis=1)
truth = model.base_parameters(model.VALUES)
tau = model.inverse_dynamics(q, qd, qdd, truth) + np.random.default_rng(0).normal(0, 0.2, q.shape)

record = runtime.Record(t, q, tau)
result = runtime.identify(model, record, runtime.Study(signals={"lowpass": {"cutoff": 20}}))
print(result.verdict)
found = result.estimate
for name, x, sigma, true in zip(found.names, found.X, found.sigma_corrected, truth, strict=True):
    print(f"{name:8} {x:9.4f} +- {sigma:.4f}   truth {true:9.4f}")
