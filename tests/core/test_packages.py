"""What `runtime` needs: Record and least squares of arrays run where NumPy, SciPy and pydantic are
installed, and nothing else.
"""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
OTHERS = (
    "casadi", "clarabel", "matplotlib", "jinja2", "ruamel", "pint", "pooch", "threadpoolctl", "typer",
    "rich", "sympy", "polars", "h5py", "rosbags", "mujoco", "symgen",
)  # fmt: skip
SCRIPT = f"""
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {OTHERS}:
            raise ModuleNotFoundError(name, name=name)
sys.meta_path.insert(0, Absent())
import numpy as np
import planar_2r_model as planar
import runtime
t = np.arange(2000) / 200.0
q = np.column_stack([np.sin(2 * t) + 0.3 * np.cos(5 * t), 0.5 * np.cos(3 * t) + 0.2 * np.sin(7 * t)])
qd, qdd = np.gradient(q, 1 / 200.0, axis=0), None
qdd = np.gradient(qd, 1 / 200.0, axis=0)
X = np.arange(1.0, 1 + len(planar.BASE_PARAMETERS))
tau = planar.regressor(q, qd, qdd) @ X
record = runtime.Record(t, q, tau)
"""
CALLS = {
    "resample": "assert len(runtime.resample(t, q)[0]) == 2000",
    "observe": "assert runtime.observe(planar, record).W.shape[1] == len(X)",
    "estimate": "assert np.abs(runtime.estimate(planar, record).X / X - 1).max() < 0.1",
    "weighted": "assert runtime.estimate(planar, record, runtime.Study(estimate={'method': 'wls'}))",
    "essential": "assert runtime.essential(planar, record).names",
    "cestac": "assert runtime.cestac(planar, record).levels",
}


@pytest.mark.parametrize("call", CALLS)
def test_arrays_need_numpy_scipy_and_pydantic_alone(call: str) -> None:
    path = f"{ROOT}:{ROOT / 'tests' / 'support'}"
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT + CALLS[call]],
        capture_output=True,
        text=True,
        env={"PYTHONPATH": path, "OMP_NUM_THREADS": "1"},
        check=False,
    )
    assert done.returncode == 0, done.stderr
