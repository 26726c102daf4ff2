"""A closed loop: relations of the passive joints of a parallelogram, and a four-bar linkage that
has no such relation.
"""

import matplotlib.pyplot as plt
import numpy as np

import symgen

for name in ("sr400", "four_bar"):
    base = symgen.regrouping(symgen.load_robot(name))
    print(f"{name}: {len(base)} base parameters, {base.method}")
    model = symgen.model(name)
    q = np.linspace(0.9, 1.1, 3)[:, None] - 0.2 * np.arange(len(model.JOINTS))
    print(f"  actuated {model.JOINTS}, passive {model.PASSIVE}; positions of the passive ones:")
    for active, passive in zip(q, model.passive_joints(q), strict=True):
        print("  ", active.round(3), "->", passive.round(4))

bars = symgen.model("four_bar")
crank = np.linspace(0.7, 1.3, 61)[:, None]
plt.figure()
plt.plot(crank, bars.passive_joints(crank), label=[f"q{j}" for j in bars.PASSIVE])
plt.xlabel("q1 of the crank, rad")
plt.ylabel("passive joints, rad")
plt.legend()
plt.savefig("closed_loop.png")
