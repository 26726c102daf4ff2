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

names = base.robot.parameters
K = np.array([[name in parameter.combination for name in names] for parameter in base.base])
plt.figure(figsize=(14, 7))
plt.spy(K, aspect="auto", markersize=4)
plt.xticks(range(len(names)), names, rotation=90, fontsize=6)
plt.yticks(range(len(K)), base.names, fontsize=6)
plt.title("Rows: base parameters. Columns: what each is made of")
plt.savefig("base_parameters.png")
