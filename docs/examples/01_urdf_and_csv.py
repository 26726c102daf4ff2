"""A URDF and a CSV: values with intervals, a verdict, and measured beside predicted torques."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import runtime
import symgen

link = "<inertial><origin xyz='{c} 0 0'/><mass value='{M}'/><inertia ixx='0.01' iyy='{I}' izz='{I}' ixy='0' ixz='0' iyz='0'/></inertial>"
joint = "<axis xyz='0 1 0'/><limit lower='-2' upper='2' velocity='3' effort='80'/><dynamics damping='0' friction='0'/>"
Path("arm.urdf").write_text(
    "<robot name='arm'><link name='base'/>"
    f"<link name='upper'>{link.format(c=0.2, M=4, I=0.06)}</link>"
    f"<link name='fore'>{link.format(c=0.15, M=2, I=0.02)}</link>"
    f"<joint name='lift' type='revolute'><parent link='base'/><child link='upper'/>{joint}</joint>"
    "<joint name='elbow' type='revolute'><parent link='upper'/><child link='fore'/>"
    f"<origin xyz='0.4 0 0'/>{joint}</joint></robot>"
)
model = symgen.model("arm.urdf")

# Your controller writes this file. Here a heavier arm with friction does.
t = np.arange(0, 20, 0.004)
w, a = np.array([[0.9, 1.3], [2.3, 3.1]]), np.array([[0.8, 0.6], [0.3, 0.4]])
phase = w * t[:, None, None]
q = (a * np.sin(phase)).sum(1)
qd, qdd = (a * w * np.cos(phase)).sum(1), (-a * w**2 * np.sin(phase)).sum(1)
friction = {"FV1": 2.0, "FS1": 1.5, "FV2": 1.0, "FS2": 0.8}
X = model.base_parameters(dict(model.VALUES) | {"M2": 2.6, "MX2": 0.42} | friction)
tau = model.inverse_dynamics(q, qd, qdd, X) + np.random.default_rng(0).normal(0, 0.2, q.shape)
np.savetxt(
    "run.csv", np.column_stack([t, q, tau]), delimiter=",", header="t,q1,q2,tau1,tau2", comments=""
)

result = runtime.identify(model, runtime.read_record("run.csv", model))
print(result)

predicted = model.inverse_dynamics(q, qd, qdd, result.estimate.X)
figure, axes = plt.subplots(2, sharex=True)
for j, axis in enumerate(axes):
    axis.plot(t, tau[:, j], color="0.75", lw=3, label="measured")
    axis.plot(t, predicted[:, j], color="0.1", lw=0.8, label="predicted")
    axis.set_ylabel(f"joint {j + 1}, N m")
axes[0].legend(ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1))
axes[1].set_xlabel("time, s")
figure.savefig("urdf_and_csv.png")
