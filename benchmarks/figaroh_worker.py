"""The identification of a serial robot by figaroh, run by the Python that has figaroh; started by
figaroh_job.py.

One JSON line with settings on standard input; then for every line `run` the job is done once and a
JSON line with its CPU seconds, and those of reading the files, is written. The line `result` writes
what the last run found. figaroh's own steps are used as they are: median, filter, differentiation,
regressor, decimation, base parameters by QR, least squares, relative deviations. Only what figaroh
asks its users for is written here: reading the files, the drives, and the three columns of the
coupled wrist. Its validation is left out, which evaluates the regressor a second time.
"""

import contextlib
import io
import json
import sys
import tempfile
import time
from math import cos, sin
from pathlib import Path

import numpy as np
import pandas
from figaroh.tools.robot import Robot

sys.path.insert(0, str(Path(__file__).resolve().parent / "tools"))

from tool_figaroh import Configured

LINK = """<link name="link{j}"><inertial><origin xyz="0 0 0"/><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
"""
JOINT = """<joint name="joint{j}" type="revolute"><parent link="link{ant}"/><child link="link{j}"/><axis xyz="0 0 1"/>
<origin xyz="{x!r} {y!r} {z!r}" rpy="{alpha!r} 0 0"/><limit lower="-10" upper="10" effort="1000" velocity="100"/></joint>
"""


def urdf(frames):
    """Text of a URDF with the geometry of frames (j, ant, alpha, d, r) and inertias of no meaning."""
    text = '<robot name="robot"><link name="link0"/>'
    for j, ant, alpha, d, r in frames:
        text += LINK.format(j=j) + JOINT.format(
            j=j, ant=ant, x=d, y=-r * sin(alpha), z=r * cos(alpha), alpha=alpha
        )
    return text + "</robot>"


class Identification(Configured):
    """The job with settings in place of a configuration file."""

    def __init__(self, robot, settings):
        self.settings = settings
        super().__init__(robot, coupled=(4, 5))
        self.filter_config = {
            "differentiation_method": "gradient",
            "filter_params": settings["filter"],
        }

    def load_trajectory_data(self, data_source=None):
        start = time.process_time()
        q, tau = (pandas.read_csv(file).to_numpy() for file in self.settings["files"])
        ratio = np.array(self.settings["ratio"])
        self.reading = time.process_time() - start
        return {
            "timestamps": np.arange(len(q))[:, None] / self.settings["filter"]["f_sample"],
            "positions": q @ np.linalg.inv(ratio).T + self.settings["offset"],
            "velocities": None,
            "accelerations": None,
            "torques": tau @ ratio,
        }


def job(robot, settings):
    """The identification, from files to base parameters and their deviations."""
    found = Identification(robot, settings)
    found.initialize(truncate=settings["truncate"])
    found.solve(
        decimate=True, decimation_factor=settings["factor"], zero_tolerance=1e-3, plotting=False
    )
    return found


def main():
    settings = json.loads(sys.stdin.readline())
    out, found = sys.stdout, None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(urdf(settings["frames"]))
        robot = Robot(str(path), package_dirs=folder)
        robot.model.gravity.linear = np.array(settings["gravity"])
    for line in sys.stdin:
        if line.strip() == "result":
            answer = {
                "Y": found.tau_noised.tolist(),
                "predicted": found.tau_identif.tolist(),
                "parameters": len(found.phi_base),
                "deviations": np.asarray(found.std_relative).tolist(),
            }
        else:
            start = time.process_time()
            with contextlib.redirect_stdout(io.StringIO()):  # figaroh prints a report
                found = job(robot, settings)
            answer = {"seconds": time.process_time() - start, "reading": found.reading}
        print(json.dumps(answer), file=out, flush=True)


if __name__ == "__main__":
    main()
