"""The `values` of the packaged tx40: a consistent arm whose base parameters are those of Table 2 of
the chapter.

Run `python tests/description/make_tx40_values.py` (pip install cvxpy) and paste its output into
`symgen/description/robots/tx40.yaml`.

Table 2 fixes 21 base parameters; infinitely many arms have them. This one is nearest to a prior of
six homogeneous boxes, in the coordinate-free distance of their pseudo-inertias P_j (4x4, about the
link frame origin):

    min  sum_j ||P0_j^-1/2 (P_j - P0_j) P0_j^-1/2||^2 + sum_k (Ia_k/Ia0_k - 1)^2
    s.t. P_j - P0_j/4 psd,  ZZ1R, MX2R, XX3R, MX3 of eq. (27) as in Table 2 .

Sizes and masses of the boxes are guesses from the outline of the arm: 19 kg move, of an arm of 27
kg. Friction, offsets and Ia that Table 2 gives are taken over; FS6, FSM6 are rounded from published
simulations of this arm, FVM6 is below FV5 and FV6 so that motor 6 and each joint dissipate by
themselves; Ia1 and Ia2 are free, their prior is of the same origin; the other offsets are invented.
After rounding, MX2, XX3 and ZZ1 are set so that the equalities hold in exact arithmetic.
"""

from __future__ import annotations

from fractions import Fraction

import cvxpy as cp
import numpy as np

D3 = RL4 = Fraction("0.225")  # m
INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
MASSES = {f"M{j}" for j in range(1, 7)}
TABLE_2 = {"ZZ1R": "1.230", "MX2R": "2.090", "XX3R": "0.127", "MX3": "0.045"}
PRIOR = {  # link: mass kg, centre m, edges m, in the link frame
    1: (7.0, (0.005, -0.010, -0.060), (0.22, 0.22, 0.30)),
    2: (5.0, (0.105, 0.004, 0.030), (0.36, 0.13, 0.12)),
    3: (3.6, (0.012, -0.030, -0.008), (0.14, 0.20, 0.13)),
    4: (2.2, (0.002, 0.006, -0.110), (0.10, 0.11, 0.24)),
    5: (1.0, (-0.002, 0.010, 0.003), (0.08, 0.12, 0.08)),
    6: (0.2, (0.001, -0.001, 0.060), (0.06, 0.06, 0.04)),
}
ACTUATORS = {"Ia1": 0.5, "Ia2": 0.5}  # priors, kg m^2
GIVEN = {  # Table 2; FS6, FVM6, FSM6 and OFFSET 1, 2, 3, 5 assumed
    "Ia3": 0.084, "Ia4": 0.027, "Ia5": 0.053, "Ia6": 0.014,
    "FV1": 8.07, "FV2": 5.55, "FV3": 2.24, "FV4": 1.13, "FV5": 2.01, "FV6": 0.721, "FVM6": 0.7,
    "FS1": 5.78, "FS2": 7.54, "FS3": 5.86, "FS4": 2.31, "FS5": 3.78, "FS6": 1.8, "FSM6": 1.6,
    "OFFSET1": 0.3, "OFFSET2": -0.4, "OFFSET3": 0.2, "OFFSET4": 0.096, "OFFSET5": -0.1,
    "OFFSET6": 0.166,
}  # fmt: skip


def box(mass, centre, edges):
    """Pseudo-inertia about the frame origin of a homogeneous box: second moments S, first moments,
    mass.
    """
    c = np.array(centre)
    S = mass * (np.diag(np.square(edges)) / 12 + np.outer(c, c))
    return np.block([[S, mass * c[:, None]], [mass * c[None, :], np.array([[mass]])]])


def parameters(P):
    """XX .. M of a pseudo-inertia: I = tr(S) 1 - S."""
    return [
        P[1, 1] + P[2, 2],
        -P[0, 1],
        -P[0, 2],
        P[0, 0] + P[2, 2],
        -P[1, 2],
        P[0, 0] + P[1, 1],
        P[0, 3],
        P[1, 3],
        P[2, 3],
        P[3, 3],
    ]


def solve():
    """Standard parameters of the nearest arm, not rounded."""
    P0 = {j: box(*row) for j, row in PRIOR.items()}
    P = {j: cp.Variable((4, 4), symmetric=True) for j in PRIOR}
    chi = {
        f"{name}{j}": p for j in PRIOR for name, p in zip(INERTIAL, parameters(P[j]), strict=True)
    }
    chi |= {name: cp.Variable() for name in ACTUATORS}
    cost = sum(cp.square(chi[name] / prior - 1) for name, prior in ACTUATORS.items())
    for j in PRIOR:
        T = np.linalg.inv(np.linalg.cholesky(P0[j]))
        cost += cp.sum_squares(T @ P[j] @ T.T - np.eye(4))
    constraints = [P[j] - P0[j] / 4 >> 0 for j in PRIOR]
    constraints += [
        value == float(TABLE_2[name])
        for name, value in regrouped(chi, float(D3), float(RL4)).items()
    ]
    cp.Problem(cp.Minimize(cost), constraints).solve(solver=cp.CLARABEL)
    return {name: float(value.value) for name, value in chi.items()}


def regrouped(p, d3, rl4):
    """The rows of eq. (27), and MX3, that Table 2 gives."""
    M456 = p["M4"] + p["M5"] + p["M6"]
    return {
        "ZZ1R": p["Ia1"] + d3**2 * (p["M3"] + M456) + p["YY2"] + p["YY3"] + p["ZZ1"],
        "MX2R": d3 * (p["M3"] + M456) + p["MX2"],
        "XX3R": 2 * p["MZ4"] * rl4 + M456 * rl4**2 + p["XX3"] - p["YY3"] + p["YY4"],
        "MX3": p["MX3"],
    }


def rounded(chi):
    """Few digits, and the equalities exact: ZZ1, MX2, XX3, MX3 each occur in one of them only."""
    exact = {
        name: Fraction(f"{value:.{2 if name in MASSES else 6}f}") for name, value in chi.items()
    }
    rest = regrouped(exact, D3, RL4)
    for parameter, base in (("ZZ1", "ZZ1R"), ("MX2", "MX2R"), ("XX3", "XX3R"), ("MX3", "MX3")):
        exact[parameter] += Fraction(TABLE_2[base]) - rest[base]
    return {name: float(value) for name, value in exact.items()} | GIVEN


def main():
    values = rounded(solve())
    for j in PRIOR:
        for k, families in enumerate((INERTIAL[:6], INERTIAL[6:], ("Ia", "FV", "FS", "OFFSET"))):
            row = ", ".join(f"{family}{j}: {values[f'{family}{j}']!r}" for family in families)
            print(("  {" if (j, k) == (1, 0) else "   ") + row + ",")
    print(f"   FVM6: {values['FVM6']!r}, FSM6: {values['FSM6']!r}}}")


if __name__ == "__main__":
    main()
