"""Base parameters of a robot: what can be identified, and what each is made of."""

import matplotlib.pyplot as plt
import numpy as np

import symgen

base = symgen.regrouping(symgen.load_robot("puma560"))
print(
    f"{len(base)} of {len(base.robot.parameters)} parameters can be identified; proved: "
    f"{symgen.certificate(base).valid}"
)
for parameter in base.base:
    if parameter.name != parameter.own:  # it absorbs others
        print(f"{parameter.name:6} = {parameter.formula}")
print("no effect:", *base.no_effect)

sums = [parameter for parameter in base.base if len(parameter.combination) > 1]
names = [x for x in base.robot.parameters if any(x in row.combination for row in sums)]
K = np.array([[name in row.combination for name in names] for row in sums])
plt.figure()
plt.spy(K, aspect="auto", markersize=4)
plt.xticks(range(len(names)), names, rotation=90, fontsize=7)
plt.yticks(range(len(K)), [row.name for row in sums], fontsize=7)
plt.xlabel("each row is a sum of these parameters")
plt.savefig("base_parameters.png")
