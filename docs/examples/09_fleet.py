"""Many robots at once: one table; a job that fails has its reason there and the others go on."""

import tempfile
from pathlib import Path

import numpy as np

import symgen
from runtime.identification.fleet import identify_fleet

folder = Path(tempfile.mkdtemp())
model = symgen.model("planar_2r")

t = np.arange(0, 20, 0.005)
w, a = (
    np.array([[0.9, 1.3], [2.3, 3.1], [4.7, 6.1]]),
    np.array([[0.8, 0.6], [0.3, 0.4], [0.15, 0.2]]),
)
phase = t[:, None, None] * w
q = (a * np.sin(phase)).sum(axis=1)
qd, qdd = (a * w * np.cos(phase)).sum(axis=1), (-a * w**2 * np.sin(phase)).sum(axis=1)
jobs = []
for number, mass in enumerate((2.0, 2.5, 3.0)):
    X = model.base_parameters({**model.VALUES, "M2": mass})
    tau = model.inverse_dynamics(q, qd, qdd, X) + np.random.default_rng(number).normal(
        0, 0.2, q.shape
    )
    np.savetxt(
        folder / f"arm{number}.csv",
        np.column_stack([t, q, tau]),
        delimiter=",",
        header="t,q1,q2,tau1,tau2",
        comments="",
    )
    jobs.append(f"  - {{name: arm {number}, robot: planar_2r, record: arm{number}.csv}}\n")
jobs.append("  - {name: missing, robot: planar_2r, record: arm9.csv}\n")
(folder / "fleet.yaml").write_text("symgen: 1\njobs:\n" + "".join(jobs))
print(identify_fleet(folder / "fleet.yaml", load=symgen.model))
