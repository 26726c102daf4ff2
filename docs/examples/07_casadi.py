"""The CasADi target: models as functions with derivatives, here the exact derivative of the torques
by position.
"""

import casadi as ca
import numpy as np

import symgen

arm = symgen.model("planar_2r", target="casadi")

q, qd, qdd, X = (
    ca.SX.sym(name, n)
    for name, n in (("q", 2), ("qd", 2), ("qdd", 2), ("X", len(arm.BASE_PARAMETERS)))
)
tau = arm.inverse_dynamics(q, qd, qdd, X, *arm.CONSTANTS.values())
stiffness = ca.Function("stiffness", [q, qd, qdd, X], [ca.jacobian(tau, q)])
print(np.array(stiffness([0.3, -0.5], [1, 2], [0, 0], np.ones(len(arm.BASE_PARAMETERS)))))
