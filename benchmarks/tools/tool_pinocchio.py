"""pinocchio's regressor and NumPy's least squares: what a user writes who has no tool.

His setting: the smallest singular value that counts, beside the largest."""

import numpy as np
import pinocchio as pin


def columns(model, data, coupled, q, qd, qdd):
    """Rows joint by joint; behind the bodies viscous, dry friction, rotor and offset of each joint."""
    n, K = model.nv, len(q)
    W = np.zeros((K, n, 14 * n + 3))
    for k in range(K):
        W[k, :, : 10 * n] = pin.computeJointTorqueRegressor(model, data, q[k], qd[k], qdd[k])
    for j in range(n):
        W[:, j, 10 * n + 4 * j : 10 * n + 4 * j + 4] = np.stack(
            [qd[:, j], np.sign(qd[:, j]), qdd[:, j], np.ones(K)], axis=1
        )
    if len(coupled):
        i, j = coupled
        both = np.sign(qd[:, i] + qd[:, j])
        W[:, i, -3:] = np.stack([qdd[:, j], qd[:, j], both], axis=1)
        W[:, j, -3:] = np.stack([qdd[:, i], qd[:, i], both], axis=1)
    return W.reshape(K * n, -1)


def fit(job):
    model = pin.buildModelFromUrdf(job.urdf)
    data = model.createData()
    W = columns(model, data, job.coupled, job.q, job.qd, job.qdd)
    X = np.linalg.lstsq(W, job.tau.ravel(), rcond=job.option)[0]

    def predict(q, qd, qdd):
        return (columns(model, data, job.coupled, q, qd, qdd) @ X).reshape(q.shape)

    return predict, {}
