"""A record larger than memory: read by blocks, the same parameters."""

import tempfile
from pathlib import Path

import numpy as np

import runtime
import symgen
from runtime.records.reading_by_blocks import records_or_streams

model = symgen.model("planar_2r")
t = np.arange(0, 20, 0.002)
w, a = (
    np.array([[0.9, 1.3], [2.3, 3.1], [4.7, 6.1]]),
    np.array([[0.8, 0.6], [0.3, 0.4], [0.15, 0.2]]),
)
phase = t[:, None, None] * w
q = (a * np.sin(phase)).sum(axis=1)
qd, qdd = (a * w * np.cos(phase)).sum(axis=1), (-a * w**2 * np.sin(phase)).sum(axis=1)
tau = model.inverse_dynamics(
    q, qd, qdd, model.base_parameters(model.VALUES)
) + np.random.default_rng(0).normal(0, 0.2, q.shape)
log = Path(tempfile.mkdtemp()) / "log.csv"
np.savetxt(
    log, np.column_stack([t, q, tau]), delimiter=",", header="t,q1,q2,tau1,tau2", comments=""
)

study = runtime.Study(
    record={"files": [str(log)]}, signals={"lowpass": {"cutoff": 20}}, stream=1000
)  # blocks of 1000 samples
by_blocks = runtime.estimate(model, records_or_streams(study.record, model, study.stream), study)
at_once = runtime.estimate(model, runtime.read_record(log, model), study)
print("largest difference, in sigma:", np.abs((by_blocks.X - at_once.X) / at_once.sigma).max())
