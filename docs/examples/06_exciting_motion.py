"""A motion that tells the parameters apart, within the limits of the robot: the command from Python."""

import json
import tempfile
from pathlib import Path

from symgen.cli.main import app

folder = Path(tempfile.mkdtemp())
study = folder / "search.yaml"
study.write_text("excitation: {parts: [{family: fourier, period: 5, harmonics: 3}], starts: 2, iterations: 50, rate: 200}\n")
robot = folder / "arm.yaml"
app(["convert", "planar_2r", str(robot)], standalone_mode=False)
app(["excite", str(robot), str(study), "-o", str(folder / "out")], standalone_mode=False)
found = json.loads((folder / "out" / "excitation.json").read_text())
print(f"{found['duration']} s, condition {found['cond']:.1f}; predicted %sigma: {found['relative_sigma']}")
