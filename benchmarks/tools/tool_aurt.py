"""AURT 0.0.4: its four steps with files, as its README has them; its filters with the cut-off given.

Modified Denavit-Hartenberg parameters d, a, alpha alone: angles that stand in the table are added to
the positions. Neither rotors nor offsets; torques stand for currents.
"""

import logging

import numpy as np
from aurt.caching import PersistentPickleCache
from aurt.data_processing import convert_file_to_mdh
from aurt.rigid_body_dynamics import RigidBodyDynamics
from aurt.robot_calibration import RobotCalibration
from aurt.robot_dynamics import RobotDynamics

FIELDS = ("target_q", "target_qd", "target_qdd", "target_current", "actual_current",
          "target_moment", "actual_q", "actual_qd")  # fmt: skip
MODELS = {}


def compiled(job):
    """The model, once for a robot."""
    if "model" not in MODELS:
        if not len(job.mdh):
            raise NotImplementedError("AURT's tables are those of chains of revolute joints")
        path = job.folder / "mdh.csv"
        np.savetxt(path, job.mdh[1:, :3], delimiter=",", header="d,a,alpha", comments="")
        folder = job.folder / "cache"
        folder.mkdir(exist_ok=True)
        cache, log = PersistentPickleCache(str(folder)), logging.getLogger("aurt")
        bodies = RigidBodyDynamics(log, convert_file_to_mdh(str(path)), cache, False)
        MODELS["model"] = RobotDynamics(
            bodies, log, cache, viscous_friction_powers=[1], friction_torque_model="none"
        )
    return MODELS["model"]


def log_file(job):
    n, path = job.raw_q.shape[1], job.folder / "data.csv"
    q, zero = job.raw_q + job.mdh[:n, 3], np.zeros_like(job.raw_q)
    given = {"actual_q": q, "actual_current": job.raw_tau}
    step = max(round(0.002 * (len(job.t) - 1) / (job.t[-1] - job.t[0])), 1)
    table = np.column_stack([job.t, *(given.get(field, zero) for field in FIELDS)])[::step]
    names = ["timestamp", *(f"{field}_{j}" for field in FIELDS for j in range(n))]
    np.savetxt(path, table, header=" ".join(names), comments="", fmt="%.9g")
    return str(path)


def fit(job):
    model = compiled(job)
    RobotCalibration.f_dyn = job.cutoff
    tilt = job.mdh[0, 2]  # of joint 1, which its tables leave out
    gravity = -9.81 * np.array([0, np.sin(tilt), np.cos(tilt)])
    calibration = RobotCalibration(logging.getLogger("aurt"), model, log_file(job), gravity)
    X = calibration.calibrate()

    def predict(q, qd, qdd):
        states = np.empty((3 * q.shape[1], len(q)))
        states[0::3], states[1::3], states[2::3] = (q + job.mdh[: q.shape[1], 3]).T, qd.T, qdd.T
        return np.stack(
            [model.observation_matrix_joint(j, states) @ X for j in range(q.shape[1])], axis=1
        )

    return predict, {}
