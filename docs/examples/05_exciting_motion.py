"""A motion that separates the parameters, within the limits of the robot: values of the robot
file stand for those not yet identified.
"""

import matplotlib.pyplot as plt

import runtime
import symgen

model = symgen.model("planar_2r")
parts = [{"family": "fourier", "period": 5, "harmonics": 3}]
study = runtime.Study(excitation={"parts": parts, "starts": 2, "iterations": 50, "rate": 200})
result = runtime.excite(model, study=study)
print(result)
t, q, qd, qdd, tau = result.sampled()
print(f"{len(t)} samples, largest torques {abs(tau).max(axis=0).round(1)} N m")

plt.figure()
plt.plot(t, q, label=[f"joint {j}" for j in model.JOINTS])
plt.xlabel("time, s")
plt.ylabel("position, rad")
plt.legend()
plt.savefig("exciting_motion.png")
