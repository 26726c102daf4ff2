"""FloBaRoID's method, written anew from its published settings (configs/kuka_lwr4.yaml), since no
package index has it.

Base parameters by QR of a regressor of 5,000 random states (minTol 1e-4), then two semidefinite
programs: the least error among standard parameters of physical bodies, masses within 50 % of those
of the robot file and their sum within 30 %, frictions not negative and drawn to zero a little; then,
of those of that error, the ones nearest to the robot file. Its model has viscous and dry friction
and an offset, no rotors.
"""

import cvxpy as cp
import numpy as np
import pinocchio as pin


def columns(model, q, qd, qdd):
    data, n = model.createData(), model.nv
    W = np.zeros((len(q), n, 13 * n))
    for k in range(len(q)):
        W[k, :, : 10 * n] = pin.computeJointTorqueRegressor(model, data, q[k], qd[k], qdd[k])
        W[k, :, 10 * n :] = np.hstack([np.diag(qd[k]), np.diag(np.sign(qd[k])), np.eye(n)])
    return W.reshape(len(q) * n, -1)


def pseudo_inertia(p):
    m, h = p[0], p[1:4]
    I = cp.bmat([[p[4], p[5], p[7]], [p[5], p[6], p[8]], [p[7], p[8], p[9]]])
    first = cp.reshape(h, (3, 1), order="F")
    second = 0.5 * cp.trace(I) * np.eye(3) - I
    return cp.bmat([[second, first], [first.T, cp.reshape(m, (1, 1), order="F")]])


def fit(job):
    model = pin.buildModelFromUrdf(job.urdf)
    n, rng = model.nv, np.random.default_rng(0)
    known = np.concatenate([I.toDynamicParameters() for I in model.inertias[1:]])
    random = [
        rng.uniform(-1, 1, (5000 // n, n)) * np.abs(x).max(axis=0) for x in (job.q, job.qd, job.qdd)
    ]
    _, s, Vt = np.linalg.svd(np.linalg.qr(columns(model, *random))[1])
    base = Vt[: np.sum(s > 1e-4 * s[0])]  # W x = (W base') (base x)
    Q, R = np.linalg.qr(columns(model, job.q, job.qd, job.qdd) @ base.T)
    x = cp.Variable(13 * n)
    size, masses = np.linalg.norm(job.tau), 10 * np.arange(n)
    error = cp.norm(R @ (base @ x) - Q.T @ job.tau.ravel()) / size
    limits = [x[10 * n : 12 * n] >= 0]
    limits += [pseudo_inertia(x[j : j + 10]) >> 1e-9 * np.eye(4) for j in masses]
    limits += [x[masses] >= 0.5 * known[masses], x[masses] <= 1.5 * known[masses]]
    whole = np.sum(known[masses])
    limits += [cp.sum(x[masses]) >= 0.7 * whole, cp.sum(x[masses]) <= 1.3 * whole]
    cp.Problem(cp.Minimize(error), limits).solve("CLARABEL")
    scale = np.maximum(np.abs(known), 1e-2 * np.abs(known).max())
    nearest = cp.norm((x[: 10 * n] - known) / scale)
    least = 1.0001 * error.value + 1e-6
    cp.Problem(cp.Minimize(nearest), [*limits, error <= least]).solve("CLARABEL")
    X = x.value

    def predict(q, qd, qdd):
        return (columns(model, q, qd, qdd) @ X).reshape(q.shape)

    return predict, {}
