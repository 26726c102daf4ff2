"""Stand-in for the emitted module of the EMPS axis with friction of its own for each direction of
motion (no offset).
"""

import numpy as np

NAME = "emps_asymmetric"
SCHEMA = 1
JOINTS = (1,)
BASE_PARAMETERS = ("M1R", "FVP1", "FSP1", "FVN1", "FSN1")
STANDARD_PARAMETERS = ("M1", "Ia1", "FVP1", "FSP1", "FVN1", "FSN1")
UNITS = {"M1R": "kg", "FVP1": "N s/m", "FSP1": "N", "FVN1": "N s/m", "FSN1": "N"}
FORMULAS = {"M1R": "M1 + Ia1", "FVP1": "FVP1", "FSP1": "FSP1", "FVN1": "FVN1", "FSN1": "FSN1"}
STRUCTURE = np.array([[True], [True], [True], [True], [True]])
DRIVES = None
LIMITS = {}
VALUES = {}
CONSTANTS = {}
SOURCE_SHA256 = "0" * 64


def store(N):
    return np.zeros((5, 1, N))


def regressor(q, qd, qdd, *, out=None):
    S = store(len(q)) if out is None else out
    v = qd[:, 0]
    S[0, 0] = qdd[:, 0]
    S[1, 0] = np.maximum(v, 0)
    S[2, 0] = v > 0
    S[3, 0] = np.minimum(v, 0)
    S[4, 0] = -1.0 * (v < 0)
    return S.transpose(2, 1, 0)


def observation_matrix(q, qd, qdd, *, out=None):
    return regressor(q, qd, qdd, out=out).transpose(2, 1, 0).reshape(5, -1).T


def base_parameters(standard):
    return np.array(
        [
            standard["M1"] + standard["Ia1"],
            standard["FVP1"],
            standard["FSP1"],
            standard["FVN1"],
            standard["FSN1"],
        ]
    )


def inverse_dynamics(q, qd, qdd, X):
    return regressor(q, qd, qdd) @ X
