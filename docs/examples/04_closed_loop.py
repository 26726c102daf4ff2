"""A closed loop: relations of the passive joints of a parallelogram, and a four-bar linkage that has no such relation."""

import tempfile
from pathlib import Path

import numpy as np

from runtime import load_model
from symgen import generate_module, load_robot, regroup

for name in ("sr400", "four_bar"):
    robot = load_robot(name)
    regrouping = regroup(robot)
    print(f"{name}: {len(regrouping)} base parameters, {regrouping.method}")
    module = Path(tempfile.mkdtemp()) / f"{name}.py"
    module.write_text(generate_module(robot))
    model = load_model(module)
    q = np.linspace(0.9, 1.1, 3)[:, None] - 0.2 * np.arange(len(model.JOINTS))
    print(f"  actuated {model.JOINTS}, passive {model.PASSIVE}; positions of the passive ones:")
    for active, passive in zip(q, model.passive_joints(q), strict=True):
        print("  ", active.round(3), "->", passive.round(4))
