"""The installed package, in a folder that holds nothing, with the core dependencies alone: every
module is imported, every verb runs, and what needs an extra says which in one line.

    python smoke.py [--extras]      optional libraries may be there, their lines are not asked for
"""

import importlib
import json
import pkgutil
import subprocess
import sys
from importlib.metadata import distribution
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import runtime
import symgen

SYMGEN = str(Path(sys.executable).with_name("symgen"))
EXTRAS = (  # extra, a command that needs it
    ("tables", ["identify", "planar_2r", "run.parquet"]),
    ("tables", ["identify", "planar_2r", "run.mat"]),
    ("bags", ["identify", "planar_2r", "run.bag"]),
    ("mjcf", ["check", "arm.xml"]),
    ("studio", ["studio"]),
)
LOOP = """symgen: 1
controller:
  law: {kind: cascade, kp: 160.18, kv: 243.45, gain: 35.15}
  rate: 1000
  reference:
    limits: ignore
    motion:
      parts: [{family: fourier, period: 1.0, harmonics: 2, p: [[0.0, 0.01, -0.01, 0.002, 0.003]]}]
"""


def command(*arguments: str, code: int = 0) -> str:
    """What `symgen ARGUMENTS` prints; it must end with `code` and without a traceback."""
    done = subprocess.run(
        [SYMGEN, *arguments], capture_output=True, text=True, timeout=300, check=False
    )
    if done.returncode != code or "Traceback" in done.stderr:
        sys.exit(
            f"symgen {' '.join(arguments)}: code {done.returncode}, expected "
            f"{code}\n{done.stdout}{done.stderr}"
        )
    return done.stdout + done.stderr


def main() -> None:
    """Imports, verbs, extras."""
    here = Path.cwd()
    for package in (symgen, runtime):
        if here in Path(str(package.__file__)).parents:
            sys.exit(f"{package.__name__} is that of this folder, not the installed one")
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if find_spec("starlette") or not module.name.startswith("symgen.studio."):
                importlib.import_module(module.name)
    foreign = {path.parts[0] for path in distribution("symgen").files or ()} - {
        "symgen",
        "runtime",
        "..",
    }
    if not all(name.startswith("symgen-") and name.endswith(".dist-info") for name in foreign):
        sys.exit(f"the package installs {sorted(foreign)}")

    t = np.arange(4000) / 500
    q = np.column_stack([np.sin(3 * t) + 0.4 * np.sin(9 * t), np.cos(4 * t) + 0.3 * np.sin(11 * t)])
    table = np.column_stack([t, q, 5 * np.cos(2 * t), np.sin(5 * t)])
    np.savetxt("run.csv", table, delimiter=",", header="t,q1,q2,tau1,tau2", comments="")
    Path("run.parquet").write_bytes(b"PAR1" + bytes(16) + b"PAR1")
    Path("run.mat").write_bytes(
        b"MATLAB 7.3 MAT-file".ljust(124)
        + b"\x00\x02IM"
        + bytes(384)
        + b"\x89HDF\r\n\x1a\n"
        + bytes(64)
    )
    Path("arm.xml").write_text("<mujoco/>", encoding="utf-8")
    Path("loop.yaml").write_text(LOOP, encoding="utf-8")
    Path("run.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(64))

    command("--version")
    command("new", "arm.yaml")
    command("check", "arm.yaml")
    command("show", "arm.yaml", "--html")
    command("show", "arm.yaml", "--model", "inertia_matrix", "--format", "sympy")
    command("convert", "tx40", "again.yaml")
    command("generate", "arm.yaml", "planar_2r", "-o", "models", "--target", "numpy,c")
    # torques of no robot: the verdict is No
    command("identify", "models/planar_2r.py", "run.csv", "-o", "found", "--friction", code=1)
    json.loads(Path("found/estimate.json").read_text(encoding="utf-8"))
    command("convert", "planar_2r", "planar.urdf")
    command("apply", "found", "planar.urdf", "--help")
    command("cestac", "planar_2r", "run.csv", "-o", "steps", "--delta", "1e-6", "--runs", "5")
    command("report", "planar_2r", "run.csv", "-o", "report", code=1)
    if "<svg" not in Path("report/report.html").read_text(encoding="utf-8"):
        sys.exit("report/report.html has no figure")
    command("simulate", "emps", "loop.yaml", "-o", "loop")
    command("datasets")
    command("schema")
    if "--extras" not in sys.argv:
        for extra, arguments in EXTRAS:
            said = command(*arguments, code=2)
            if f"pip install symgen[{extra}]" not in said:
                sys.exit(f"symgen {' '.join(arguments)} does not name its extra: {said}")
    print("the installed package works outside its checkout")


if __name__ == "__main__":
    main()
