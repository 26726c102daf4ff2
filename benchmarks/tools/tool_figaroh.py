"""figaroh 1.0.2: its BaseIdentification with arrays that are filtered already, weighted by joint.

Its own filters would run a second time; what is overridden is what its users override: reading the
data, and the three columns of a coupled wrist. Its users' setting: the tolerance of its QR
decomposition, for which it asks where columns are weak.
"""

import numpy as np
from figaroh.identification.base_identification import BaseIdentification
from figaroh.tools.regressor import build_regressor_basic
from figaroh.tools.robot import Robot


class Configured(BaseIdentification):
    """Settings in place of a configuration file; coupled : joints, from 0, that a motor turns both."""

    def __init__(self, robot, coupled=(), tolerance=None):
        self.coupled, self.tolerance = coupled, tolerance
        super().__init__(robot)

    def load_param(self, config_file, setting_type="identification"):
        n = self.model.nv
        self.identif_config = {
            "act_idxq": list(range(n)),
            "act_idxv": list(range(n)),
            "active_joints": list(self.model.names[1:]),
            "has_friction": True,
            "has_actuator_inertia": True,
            "has_joint_offset": True,
            "is_joint_torques": True,
            "is_external_wrench": False,
            "force_torque": None,
            "qr_relative_tolerance": self.tolerance,
            **{key: [0.0] * n for key in ("fv", "fs", "Ia", "off")},
        }

    def columns(self, q, qd, qdd):
        W = build_regressor_basic(self.robot, q, qd, qdd, self.identif_config)
        if not len(self.coupled):
            return W
        i, j = self.coupled
        wrist, both = np.zeros((q.shape[1], len(q), 3)), np.sign(qd[:, i] + qd[:, j])
        wrist[i] = np.stack([qdd[:, j], qd[:, j], both], axis=1)
        wrist[j] = np.stack([qdd[:, i], qd[:, i], both], axis=1)
        return np.hstack([W, wrist.reshape(-1, 3)])

    def calculate_full_regressor(self):
        states = (self.processed_data[key] for key in ("positions", "velocities", "accelerations"))
        self.dynamic_regressor = self.columns(*states)

    def initialize_standard_parameters(self):
        super().initialize_standard_parameters()
        if len(self.coupled):
            self.standard_parameter.update({"Iam": 0.0, "fvm": 0.0, "fsm": 0.0})

    def _compute_validation_metrics(self):
        """Left out: it would evaluate the regressor once more, without the wrist."""


class Identification(Configured):
    """Of arrays."""

    def __init__(self, job):
        self.job = job
        robot = Robot(job.urdf, package_dirs=str(job.folder))
        super().__init__(robot, job.coupled, job.option or None)

    def load_trajectory_data(self, data_source=None):
        job = self.job
        keys = ("timestamps", "positions", "velocities", "accelerations", "torques")
        values = (np.arange(len(job.q))[:, None] / 100, job.q, job.qd, job.qdd, job.tau)
        return dict(zip(keys, values, strict=True))

    def filter_kinematics_data(self, filter_config=None):
        self.processed_data = dict(self.raw_data)

    def process_torque_data(self):
        self.processed_data["torques"] = self.job.tau.T.ravel()
        return self.processed_data["torques"]


def fit(job):
    found = Identification(job)
    found.initialize()
    found.solve(decimate=False, plotting=False, wls=True)
    X, relative = np.asarray(found.phi_base), np.asarray(found.result["wls_std_deviations"])

    def predict(q, qd, qdd):
        W = np.delete(found.columns(q, qd, qdd), found._idx_eliminated, axis=1)
        return (W[:, found._base_indices] @ X).reshape(q.shape[1], -1).T

    deviations = zip(X, np.abs(X) * relative / 100, strict=True)
    return predict, dict(zip(found.params_base, deviations, strict=True))
