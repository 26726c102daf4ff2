"""Parameters that a physical robot can have, written as a URDF."""

import numpy as np

import runtime
import symgen
from symgen.description.urdf_write import write_urdf

robot = symgen.load_robot("planar_2r")
model = symgen.model(robot)
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

found = runtime.estimate(
    model,
    record,
    runtime.Study(signals={"lowpass": {"cutoff": 20}}, estimate={"method": "feasible"}),
)
text, not_carried = write_urdf(
    robot, found.details["standard"]
)  # one physical robot with these torques, of many
print(text)
print("A URDF does not carry:", *not_carried, sep="\n- ")
