"""Stand-in for the emitted module of the EMPS axis: one prismatic joint, force = M ddq + Fv dq + Fc
sign(dq) + offset.
"""

import numpy as np

NAME = "emps"
SCHEMA = 1
JOINTS = (1,)
BASE_PARAMETERS = ("M1R", "FV1", "FS1", "OFFSET1")
STANDARD_PARAMETERS = ("M1", "Ia1", "FV1", "FS1", "OFFSET1")
UNITS = {"M1R": "kg", "FV1": "N s/m", "FS1": "N", "OFFSET1": "N"}
FORMULAS = {"M1R": "M1 + Ia1", "FV1": "FV1", "FS1": "FS1", "OFFSET1": "OFFSET1"}
STRUCTURE = np.array([[True], [True], [True], [True]])
DRIVES = None
LIMITS = {}
VALUES = {}
CONSTANTS = {}
SOURCE_SHA256 = "0" * 64


def store(N):
    return np.zeros((4, 1, N))


def regressor(q, qd, qdd, *, out=None):
    S = store(len(q)) if out is None else out
    S[0, 0] = qdd[:, 0]
    S[1, 0] = qd[:, 0]
    S[2, 0] = np.sign(qd[:, 0])
    S[3, 0] = 1
    return S.transpose(2, 1, 0)


def observation_matrix(q, qd, qdd, *, out=None):
    return regressor(q, qd, qdd, out=out).transpose(2, 1, 0).reshape(4, -1).T


def base_parameters(standard):
    return np.array(
        [standard["M1"] + standard["Ia1"], standard["FV1"], standard["FS1"], standard["OFFSET1"]]
    )


def inverse_dynamics(q, qd, qdd, X):
    return regressor(q, qd, qdd) @ X
