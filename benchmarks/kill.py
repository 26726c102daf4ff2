"""SIGKILL at random moments of the commands that write: is every file old or new, is the set of one
run, does a rerun end as if nothing had been?

    python benchmarks/kill.py [VERB...] [--kills 50] [--seed 1]

Every verb that writes over what stands there: generate, convert, identify, cestac, report,
simulate, excite, compare, apply, show, check, demo (the others print, or, as `new`, never
replace a file).

Each command runs over a folder that holds the results of an earlier one (other robot constants,
another record) and a file of the user. Half of the kills come
uniformly over the time of an undisturbed run, half within the time its writing takes, from the
moment the folder of unfinished files appears. After each:

    whole      every file has the bytes of the old run or of the new one, the user's file is his
    one set    all are old, or all new; or the rest of the new ones stands in .symgen-finished, for the next command to move up
    rerun      the same command ends with the exit code and bytes of the undisturbed run, and leaves nothing else

cestac keeps its runs every 0.02 s here, instead of every 30, so that kills meet archives. Exit code
1 where a kill broke one of these.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from runtime import load_model
from runtime.parallel.checkpoint import FILE
from runtime.reporting.result_files import FINISHED, UNFINISHED
from symgen import load_robot
from symgen.emit.generate import generate_module

MAIN = "from symgen.cli.main import main; main()"
OFTEN = (
    "from runtime.parallel.checkpoint import Checkpoint; "
    "Checkpoint.__init__.__kwdefaults__['every'] = 0.02; "
) + MAIN
ROBOT = "planar_2r"
NOTE = "of the user"
POLL = 1e-4  # s, between looks at a folder
STUDY = """symgen: 1
record: {files: [../FIRST.csv]}
estimate: {method: feasible}
validate: {record: {files: [../SECOND.csv]}}
"""
LOOP = """symgen: 1
signals: {lowpass: {cutoff: 100, on: [q]}}
controller:
  law: {kind: cascade, kp: KP, kv: 243.45, gain: 35.15}
  rate: 1000
  torque: {noise: 0.5}
  reference:
    limits: ignore
    motion: {parts: [{family: fourier, period: 3.0, harmonics: 3, p: [[0.0, 0.06, -0.05, -0.01, 0.02, 0.01, -0.01333333]]}]}
"""


def write_record(
    path: Path, seed: int, robot: str = ROBOT, duration: float = 4.0, rate: float = 500.0
) -> None:
    """Positions and torques of a packaged robot on sums of sines, noise on the torques."""
    with TemporaryDirectory() as folder:
        module = Path(folder) / f"{robot}.py"
        module.write_text(generate_module(load_robot(robot)), encoding="utf-8")
        model = load_model(module, trust=True)
        generator = np.random.default_rng(seed)
        t = np.arange(int(duration * rate)) / rate
        w = 2 * np.pi * np.array([0.5, 1.25, 2.5])
        n = len(model.JOINTS)
        phase = generator.uniform(0, 2 * np.pi, (n, 3))
        angle = t[:, None, None] * w + phase
        amplitude = np.array([0.8, 0.4, 0.2])
        q, qd, qdd = (
            (amplitude * x).sum(-1)
            for x in (np.sin(angle), w * np.cos(angle), -(w**2) * np.sin(angle))
        )
        X = model.base_parameters(model.VALUES)
        tau = model.inverse_dynamics(q, qd, qdd, X) + 0.05 * generator.standard_normal(q.shape)
    header = ",".join(["t", *(f"{name}{j + 1}" for name in ("q", "tau") for j in range(n))])
    np.savetxt(
        path, np.column_stack([t, q, tau]), delimiter=",", header=header, comments="", fmt="%.12g"
    )


class Job:
    """One command, in a version `old` and a version `new` that write the same files; OUT stands for
    the folder they write into.
    """

    def __init__(
        self, folder: Path, verb: str, old: Sequence[str], new: Sequence[str], code: str = MAIN
    ) -> None:
        self.folder, self.verb, self.arguments, self.code = (
            folder,
            verb,
            {"old": old, "new": new},
            code,
        )

    def start(self, which: str, out: Path) -> subprocess.Popen[bytes]:
        command = [
            sys.executable,
            "-c",
            self.code,
            self.verb,
            *(a.replace("OUT", out.name) for a in self.arguments[which]),
        ]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        return subprocess.Popen(
            command,
            cwd=self.folder,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )

    def run(self, which: str, out: Path) -> int:
        process = self.start(which, out)
        said = process.communicate()[1].decode()
        if process.returncode not in (0, 1) or "Traceback" in said:
            raise RuntimeError(f"{self.verb} ended with {process.returncode}: {said}")
        return process.returncode


def symgen(folder: Path, *arguments: str) -> None:
    """A command that what is killed needs."""
    command = [sys.executable, "-c", MAIN, *arguments]
    ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if ended.returncode not in (0, 1):
        raise RuntimeError(ended.stderr)


def jobs(folder: Path) -> dict[str, Job]:
    """The commands, over files made in `folder`."""
    write_record(folder / "old.csv", seed=1)
    write_record(folder / "new.csv", seed=2)
    for which, seed in (("old", 1), ("new", 2)):
        write_record(folder / f"{which}-axis.csv", seed, robot="emps")
    text = (files("symgen.description") / "robots" / f"{ROBOT}.yaml").read_text(encoding="utf-8")
    for which, gravity in (("old", "9.81"), ("new", "9.80665")):
        (folder / which).mkdir()
        (folder / which / "arm.yaml").write_text(text.replace("9.81", gravity), encoding="utf-8")
        first, second = (which, "new" if which == "old" else "old")
        for name, text_of in (
            ("study.yaml", STUDY),
            ("ols.yaml", STUDY.replace("feasible", "ols")),
        ):
            settings = text_of.replace("FIRST", first).replace("SECOND", second)
            (folder / which / name).write_text(settings, encoding="utf-8")
        (folder / which / "loop.yaml").write_text(
            LOOP.replace("KP", "140" if which == "old" else "160.18"), encoding="utf-8"
        )
    out = ["-o", "OUT"]
    pairs = {which: [ROBOT, f"{which}.csv", *out] for which in ("old", "new")}
    robots = {
        which: [f"{which}/arm.yaml", "emps", "--target", "numpy,casadi,c,xp", *out]
        for which in pairs
    }
    study = {
        which: [*pairs[which], "--delta", "2*pi/5000", "--delta", "2*pi/1000", "--runs", "150"]
        for which in pairs
    }
    axis = {which: ["emps", f"{which}-axis.csv", *out] for which in pairs}
    loops = {which: ["emps", f"{which}/loop.yaml", *out] for which in pairs}
    search = {
        which: [ROBOT, "--starts", "1", "--seed", seed, *out]
        for which, seed in (("old", "1"), ("new", "2"))
    }
    other = {which: [f"{which}/arm.yaml", "OUT/other.yaml", "--force"] for which in pairs}
    symgen(folder, "convert", ROBOT, "arm.urdf")
    for which in pairs:
        symgen(folder, "identify", "arm.urdf", f"{which}/study.yaml", "-o", f"{which}-results")
    changed = {
        which: [f"{which}-results", "arm.urdf", "-o", "OUT/changed.urdf", "--force"]
        for which in pairs
    }
    studies = {which: [ROBOT, f"{which}/study.yaml", f"{which}/ols.yaml", *out] for which in pairs}
    pages = {which: [f"{which}/arm.yaml", "--html", "-o", "OUT/page.html"] for which in pairs}
    claims = {which: [f"{which}/arm.yaml", "--certificate", "OUT/claim.json"] for which in pairs}
    return {
        "generate": Job(folder, "generate", **robots),
        "convert": Job(folder, "convert", **other),
        "identify": Job(folder, "identify", **pairs),
        "cestac": Job(folder, "cestac", **study, code=OFTEN),
        "report": Job(folder, "report", **axis),
        "simulate": Job(folder, "simulate", **loops),
        "excite": Job(folder, "excite", **search),
        "compare": Job(folder, "compare", **studies),
        "apply": Job(folder, "apply", **changed),
        "show": Job(folder, "show", **pages),
        "check": Job(folder, "check", **claims),
        "demo": Job(folder, "demo", old=[*out, "--quick"], new=out),
    }


def digests(folder: Path) -> dict[str, str]:
    """SHA-256 of every file, hidden ones too, by its path."""
    found = sorted(path for path in folder.rglob("*") if path.is_file())
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in found
    }


def unfinished(folder: Path) -> list[Path]:
    """What a run is writing there."""
    return list(folder.glob(f"{UNFINISHED}*"))


def judged(folder: Path, old: dict[str, str], new: dict[str, str]) -> str:
    """What a killed run left: "old", "new" or "to complete"; RuntimeError where it is anything else."""
    if (folder / "notes.txt").read_text() != NOTE:
        raise RuntimeError("the user's file changed")
    found = digests(folder)
    found.pop("notes.txt")
    sets: dict[str, list[str]] = {}
    for name in new:
        sets.setdefault(str(Path(name).parent), []).append(name)
    shown = {
        name
        for name in found
        if not any(part.startswith((UNFINISHED, FINISHED, FILE)) for part in Path(name).parts)
    }
    if shown != set(new):
        raise RuntimeError(f"files {shown - set(new)} are left, {set(new) - shown} are missing")
    states = set()
    for parent, names in sets.items():
        waiting = {
            name: found[at]
            for name in names
            if (at := str(Path(parent, FINISHED, Path(name).name))) in found
        }
        half = [name for name in names if found[name] not in (old[name], new[name])]
        half += [name for name, digest in waiting.items() if digest != new[name]]
        if half:
            raise RuntimeError(f"{half} are neither old nor new")
        if all(found[name] == old[name] for name in names) and not waiting:
            states.add("old")
        elif all(new[name] in (found[name], waiting.get(name)) for name in names):
            states.add("to complete" if waiting else "new")
        else:
            raise RuntimeError("files of two runs are mixed")
    return " and ".join(sorted(states, reverse=True))


def survived(job: Job, kills: int, chance: random.Random) -> Counter[str]:
    """Counts of what `kills` kills left; RuntimeError at the first that broke something."""
    base, fresh = job.folder / f"{job.verb}-old", job.folder / f"{job.verb}-new"
    job.run("old", base)
    begin = time.monotonic()
    code = job.run("new", fresh)
    duration = time.monotonic() - begin
    old, new = digests(base), digests(fresh)
    if old.keys() != new.keys() or old == new:
        raise RuntimeError("the two runs write other files, or the same")
    writing = write_time(job, base)
    counts: Counter[str] = Counter()
    for k in range(kills):
        out = job.folder / f"{job.verb}-out"
        shutil.rmtree(out, ignore_errors=True)
        shutil.copytree(base, out)
        (out / "notes.txt").write_text(NOTE)
        process = job.start("new", out)
        if k % 2:
            while process.poll() is None and not unfinished(out):
                time.sleep(POLL)
            time.sleep(chance.uniform(0, writing))
        else:
            time.sleep(chance.uniform(0, duration))
        process.send_signal(signal.SIGKILL)
        process.communicate()
        state = "finished" if process.returncode != -signal.SIGKILL else judged(out, old, new)
        if (out / FILE).is_file():
            counts["with runs to go on from"] += 1
        counts[state] += 1
        counts["while writing"] += bool(unfinished(out)) or (out / FINISHED).exists()
        if job.run("new", out) != code or digests(out) != new | {
            "notes.txt": hashlib.sha256(NOTE.encode()).hexdigest()
        }:
            raise RuntimeError(
                f"the rerun differs: {sorted(set(digests(out).items()) ^ set(new.items()))}"
            )
    print(
        (
            f"{job.verb:<10}{kills} kills in runs of {duration:.2f} s, of which writing "
            f"{1000 * writing:.0f} ms:"
        ),
        dict(counts),
        flush=True,
    )
    return counts


def write_time(job: Job, base: Path) -> float:
    """s from the appearance of the folder of unfinished files to the disappearance of that of
    finished ones.
    """
    out = job.folder / f"{job.verb}-timed"
    shutil.copytree(base, out)
    process = job.start("new", out)
    while process.poll() is None and not unfinished(out):
        time.sleep(POLL)
    begin = time.monotonic()
    while process.poll() is None and (bool(unfinished(out)) or (out / FINISHED).exists()):
        time.sleep(POLL)
    found = time.monotonic() - begin
    process.communicate()
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("verbs", nargs="*", metavar="VERB")
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with TemporaryDirectory(prefix="kill-") as folder:
        known = jobs(Path(folder))
        for verb in given.verbs or known:
            try:
                survived(known[verb], given.kills, random.Random(given.seed))
            except RuntimeError as e:
                sys.exit(f"{verb}: {e}")


if __name__ == "__main__":
    main()
