"""The `values` of the packaged haptic interface: a consistent branch whose base parameters are
those of Table 6 of the chapter.

Run `python tests/description/make_haptic_values.py` (pip install cvxpy) and paste its output into
`symgen/description/robots/haptic.yaml`.

Table 6 fixes fourteen base parameters; infinitely many branches have them. This one is nearest to a
prior of six homogeneous boxes, in the coordinate-free distance of their pseudo-inertias P_j (4x4,
about the link frame origin):

    min  sum_j ||P0_j^-1/2 (P_j - P0_j) P0_j^-1/2||^2 + sum_k (Ia_k/Ia0_k - 1)^2
    s.t. P_j - P0_j/4 psd,  the nine inertial base parameters of Table 6 as printed,  those it
    leaves out at most LEFT_OUT .

Lengths, sizes and masses are guesses: an arm of 0.2 m, balanced by a mass behind the shoulder (MX2R
< 0), a forearm of 0.22 m, balanced by a mass on the crank (MX5R > MX3R), no handle. Friction of the
pivots is split by guess. The chapter says that what it left out perturbs nothing when it is
removed: LEFT_OUT, FV and OFFSET1 are so small that this holds in the simulated record of the
demonstration (1e-5 kg m weighs 1e-4 N m). After rounding, the parameter that gives each base
parameter its name is set so that the equalities hold in exact arithmetic.
"""

from __future__ import annotations

from fractions import Fraction

import cvxpy as cp
import numpy as np

D3, D4, D6 = Fraction("0.2"), Fraction("0.22"), Fraction("0.1")  # m
INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
MASSES = {f"M{j}" for j in range(1, 7)}
TABLE_6 = {
    "ZZ1R": "0.051", "MY1R": "0.024", "XX2R": "-0.023", "ZZ2R": "0.029", "MX2R": "-0.019",
    "XX3R": "-0.011", "ZZ3R": "0.014",
    "MX3R": "0.039", "MX5R": "0.068",
}  # fmt: skip
PRIOR = {  # link: mass kg, centre m, edges m, in the link frame
    1: (1.5, (0.00002, 0.0160, -0.0200), (0.14, 0.12, 0.14)),
    2: (1.1, (-0.0810, 0.00003, 0.0020), (0.16, 0.05, 0.05)),
    3: (0.22, (0.1000, 0.0001, 0.0020), (0.24, 0.03, 0.03)),
    4: (0.08, (-0.0005, 0.0010, 0.0010), (0.05, 0.05, 0.04)),
    5: (0.9, (0.0700, -0.00003, -0.0015), (0.06, 0.05, 0.05)),
    6: (0.1, (0.1000, 0.0003, -0.0020), (0.20, 0.02, 0.02)),
}
ACTUATORS = {"Ia1": 0.004, "Ia2": 0.004, "Ia5": 0.0015}  # priors, kg m^2
# largest absolute value of an inertial base parameter that Table 6 leaves out, kg m^2 or kg m
LEFT_OUT = 1e-5
GIVEN = {  # Table 6: FS1, FS2R, FS5R, OFFSET2, OFFSET5; the rest assumed
    "FS1": 0.12, "FS2": 0.09, "FSP2": 0.02, "FS4": 0.005, "FS5": 0.085, "FSP5": 0.02,
    "FV1": 0.0002, "FV2": 0.0001, "FVP2": 0.00002, "FV4": 0.00001, "FV5": 0.0001, "FVP5": 0.00002,
    "OFFSET1": 0.0002, "OFFSET2": 0.02, "OFFSET5": 0.03,
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


def regrouped(p, d3, d4, d6):
    """The inertial base parameters for q4 = -q5 (c = 0), from symgen's own formulas; the test
    evaluates those afresh.
    """
    M34 = p["M3"] + p["M4"]
    return {
        "ZZ1R": p["ZZ1"]
        + p["Ia1"]
        + p["YY2"]
        + p["YY3"]
        + p["YY4"]
        + p["YY5"]
        + p["YY6"]
        + d3**2 * M34
        + d4**2 * p["M4"]
        + d6**2 * p["M6"],
        "MX1": p["MX1"],
        "MY1R": p["MY1"] + p["MZ2"] + p["MZ3"] + p["MZ4"] + p["MZ5"] + p["MZ6"],
        "XX2R": p["XX2"] - p["YY2"] + p["XX6"] - p["YY6"] - d3**2 * M34,
        "XY2R": p["XY2"] + p["XY6"],
        "XZ2R": p["XZ2"] + p["XZ6"] - d3 * (p["MZ3"] + p["MZ4"]),
        "YZ2R": p["YZ2"] + p["YZ6"],
        "ZZ2R": p["ZZ2"] + p["Ia2"] + p["ZZ6"] + d3**2 * M34,
        "MX2R": p["MX2"] + p["MX6"] + d3 * M34,
        "MY2": p["MY2"],
        "XX3R": p["XX3"] - p["YY3"] + p["XX5"] - p["YY5"] - d4**2 * p["M4"] - d6**2 * p["M6"],
        "XY3R": p["XY3"] + p["XY5"],
        "XZ3R": p["XZ3"] - p["XZ5"] - d4 * p["MZ4"] + d6 * p["MZ6"],
        "YZ3R": p["YZ3"] - p["YZ5"],
        "ZZ3R": p["ZZ3"] + p["ZZ5"] + p["Ia5"] + d4**2 * p["M4"] + d6**2 * p["M6"],
        "MX3R": p["MX3"] + d4 * p["M4"] - d6 / d3 * p["MX6"],
        "MY3": p["MY3"],
        "MX4R": p["MX4"],
        "MX5R": p["MX5"] - d6 / d3 * p["MX6"] + d6 * p["M6"],
        "MY5": p["MY5"],
        "MY6": p["MY6"],
    }


def solve():
    """Standard parameters of the nearest branch, not rounded."""
    P0 = {j: box(*row) for j, row in PRIOR.items()}
    scale = {j: np.diag(1 / np.sqrt(np.diag(P0[j]))) for j in PRIOR}
    Q = {j: cp.Variable((4, 4), symmetric=True) for j in PRIOR}  # P_j scaled to about one
    chi = {}
    cost = 0
    constraints = []
    for j in PRIOR:
        back = np.linalg.inv(scale[j])
        P = back @ Q[j] @ back
        chi |= {f"{name}{j}": p for name, p in zip(INERTIAL, parameters(P), strict=True)}
        T = np.linalg.inv(np.linalg.cholesky(scale[j] @ P0[j] @ scale[j]))
        cost += cp.sum_squares(T @ Q[j] @ T.T - np.eye(4))
        constraints.append(Q[j] - scale[j] @ P0[j] @ scale[j] / 4 >> 0)
    for name, prior in ACTUATORS.items():
        factor = cp.Variable()
        chi[name] = prior * factor
        cost += cp.square(factor - 1)
    base = regrouped(chi, float(D3), float(D4), float(D6))
    constraints += [1e3 * base[name] == 1e3 * float(value) for name, value in TABLE_6.items()]
    constraints += [
        1e3 * cp.abs(base[name]) <= 1e3 * LEFT_OUT for name in base.keys() - TABLE_6.keys()
    ]
    problem = cp.Problem(cp.Minimize(cost), constraints)
    problem.solve(solver=cp.CLARABEL)
    return {name: float(value.value) for name, value in chi.items()}


def rounded(chi):
    """Few digits, and the equalities exact: each parameter that is changed occurs in one of them
    only.
    """
    exact = {
        name: Fraction(f"{value:.{4 if name in MASSES else 7}f}") for name, value in chi.items()
    }
    rest = regrouped(exact, D3, D4, D6)
    for base, printed in TABLE_6.items():
        exact[base.removesuffix("R")] += Fraction(printed) - rest[base]
    return {name: float(value) for name, value in exact.items()} | GIVEN


def main():
    values = rounded(solve())
    for j in PRIOR:
        for k, families in enumerate((INERTIAL[:6], INERTIAL[6:], ("Ia", "FV", "FS", "OFFSET"))):
            row = ", ".join(
                f"{name}: {values[name]!r}"
                for name in (f"{family}{j}" for family in families)
                if name in values
            )
            if row:
                print(("  {" if (j, k) == (1, 0) else "   ") + row + ",")
    print(
        "   "
        + ", ".join(f"{name}: {values[name]!r}" for name in ("FVP2", "FVP5", "FSP2", "FSP5"))
        + "}"
    )


if __name__ == "__main__":
    main()
