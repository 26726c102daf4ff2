"""The same module in CasADi: functions with derivatives, here the exact derivative of the torques by
position.
"""

import casadi as ca
import numpy as np

import symgen

arm = symgen.model("planar_2r")
torques = arm.casadi("inverse_dynamics")

q, qd, qdd, X = (
    ca.SX.sym(name, n)
    for name, n in (("q", 2), ("qd", 2), ("qdd", 2), ("X", len(arm.BASE_PARAMETERS)))
)
stiffness = ca.Function(
    "stiffness", [q, qd, qdd, X], [ca.jacobian(torques(q=q, qd=qd, qdd=qdd, X=X)["GAM"], q)]
)
print(np.array(stiffness([0.3, -0.5], [1, 2], [0, 0], np.ones(len(arm.BASE_PARAMETERS)))))
