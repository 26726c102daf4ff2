"""Whether some physical robot makes the torques that a tool predicts: one check for every tool."""

from __future__ import annotations

import clarabel
import numpy as np
import pinocchio as pin
from scipy import sparse
from tool_pinocchio import columns

Array = np.ndarray


def feasible(urdf: str, coupled: tuple[int, ...], states: list[Array], torque: Array) -> str:
    """yes, no, or the error of the torques that no parameters of this robot make.

    Of the standard parameters X0 + N z that make the torques, N the null space of the regressor,
    those are sought whose pseudo-inertias (Wensing, Kim and Slotine, 2018), rotors and frictions
    have the largest least eigenvalue t, of bodies and rotors of at most 100 times the size of X0.
    """
    model = pin.buildModelFromUrdf(urdf)
    n = model.nv
    W = columns(model, model.createData(), coupled, *states)
    scale = np.linalg.norm(W, axis=0)
    scale[scale < 1e-9 * scale.max()] = 1.0  # columns that are rounding alone
    U, s, Vt = np.linalg.svd(W / scale, full_matrices=True)
    rank = int(np.sum(s > 1e-9 * s[0]))
    X0 = Vt[:rank].T @ (U[:, :rank].T @ torque.ravel() / s[:rank]) / scale
    left = np.linalg.norm(torque.ravel() - W @ X0) / np.linalg.norm(torque)
    if left > 1e-3:
        return f"other model ({100 * left:.1f} %)"
    N = np.linalg.qr(Vt[rank:].T / scale[:, None])[0]
    rows, heads, cones = [], [], []
    for j in range(n):
        A = np.zeros((10, len(X0)))
        A[:, 10 * j : 10 * j + 10] = TRIANGLE
        rows.append(np.column_stack([-A @ N, IDENTITY]))
        heads.append(A @ X0)
        cones.append(clarabel.PSDTriangleConeT(4))
    signs = [10 * n + 4 * j + k for j in range(n) for k in range(3)]
    if coupled:  # rotor and friction of the motor that two joints share may trade with their own
        i, j = coupled
        signs = [k for k in signs if (k - 10 * n) // 4 not in (i, j)]
    rows.append(np.column_stack([-N[signs], np.zeros(len(signs))]))
    heads.append(X0[signs])
    cones.append(clarabel.NonnegativeConeT(len(signs)))
    masses = [10 * j for j in range(n)]
    limit = np.zeros((n + 1, N.shape[1] + 1))
    limit[:n, :-1], limit[n, -1] = N[masses], 1.0
    rows.append(limit)
    heads.append(np.append(1e3 - X0[masses], 1.0))
    cones.append(clarabel.NonnegativeConeT(n + 1))
    aim = np.zeros(N.shape[1] + 1)
    aim[-1] = -1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix((len(aim), len(aim))),
        aim,
        sparse.csc_matrix(np.vstack(rows)),
        np.concatenate(heads),
        cones,
        settings,
    ).solve()
    t = -solution.obj_val if "Solved" in str(solution.status) else -np.inf
    return "yes" if t > -1e-5 * np.abs(X0).max() else "no"  # what programs and files round


def _triangle() -> Array:
    """Upper triangle, column by column, of the pseudo-inertia of pinocchio's ten parameters:
    m, h (3), xx, xy, yy, xz, yz, zz about the origin of the joint.
    """
    place = {(0, 0): 4, (0, 1): 5, (1, 1): 6, (0, 2): 7, (1, 2): 8, (2, 2): 9}
    rows = []
    for b in range(4):
        for a in range(b + 1):
            row = np.zeros(10)
            if b == 3:
                row[0 if a == 3 else 1 + a] = 1.0
            elif a == b:
                row[[4, 6, 9]] = 0.5
                row[place[a, a]] -= 1.0
            else:
                row[place[a, b]] = -1.0
            rows.append(row if a == b else np.sqrt(2) * row)
    return np.array(rows)


TRIANGLE = _triangle()
IDENTITY = np.array([1.0 if a == b else 0.0 for b in range(4) for a in range(b + 1)])
