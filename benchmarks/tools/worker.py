"""Runs one tool on a folder of jobs, in the environment of the tool: `python worker.py FILE FUNCTION FOLDER`.

A job NAME.npz holds what is fitted and the states that are predicted; NAME.json is written beside
it: torques that the tool predicts, its parameters, what it printed, seconds of processor and peak
memory, or its error. Needs NumPy and Linux.
"""

import contextlib
import importlib
import io
import json
import logging
import signal
import sys
import time
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np

LIMIT, WHOLE = 90, 200  # s of processor: of one fit, of all jobs of a folder


def late(*_):
    raise TimeoutError(f"not done in {LIMIT} s")


def done(fit, job):
    """What comes of one job."""
    said = io.StringIO()
    logging.basicConfig(stream=said, level=logging.WARNING, format="%(message)s", force=True)
    warnings.simplefilter("always")
    warnings.showwarning = lambda message, *_: print(message, file=said)
    answer = {}
    start = time.process_time()
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            predict, values = fit(job)
            answer["seconds"] = time.process_time() - start
            answer["predicted"] = np.asarray(predict(*job.states)).tolist()
            answer["values"] = {str(k): [float(x) for x in v] for k, v in values.items()}
    except BaseException as e:
        if isinstance(e, KeyboardInterrupt):
            raise
        answer["error"] = f"{type(e).__name__}: {e}"[:600]
    signal.setitimer(signal.ITIMER_PROF, 0)
    answer["said"] = said.getvalue()
    status = Path("/proc/self/status").read_text()
    answer["memory"] = int(status.split("VmHWM:")[1].split()[0]) / 1024
    return answer


def main(file, function, folder):
    signal.signal(signal.SIGPROF, late)
    np.set_printoptions(precision=4)
    fit = getattr(importlib.import_module(file), function)
    answer = {}
    for path in sorted(Path(folder).glob("*.npz")):
        if path.with_suffix(".json").exists():
            continue
        data = np.load(path)
        job = SimpleNamespace(**{key: data[key] for key in data.files})
        job.robot, job.urdf = str(job.robot), str(job.urdf)
        job.cutoff, job.option = float(job.cutoff), float(job.option)
        job.final, job.folder = bool(job.final), Path(folder)
        if time.process_time() > WHOLE:
            answer = {"error": f"TimeoutError: not reached in {WHOLE} s", "said": ""}
        elif not answer.get("error", "").startswith("TimeoutError"):  # one such is enough
            answer = done(fit, job)
        path.with_suffix(".json").write_text(json.dumps(answer))


if __name__ == "__main__":
    main(*sys.argv[1:])
