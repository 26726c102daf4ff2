"""Processor seconds and peak memory of each stage of a generation with its certificate, as JSON.

    python benchmarks/stages.py humanoid30.yaml [--target numpy] [-o FOLDER] [--root CHECKOUT]

writes the files, and {stage: [seconds, MB]} as stages.json. A stage is one function of STAGES without the stages that it calls;
`other` is all else. The peak of a stage is the largest resident set of the process, Python and its
packages included, while the stage runs; Linux sets it back when a stage begins. `--root` measures
another checkout of symgen, such as an older commit. The seconds of compilers count, their memory
does not.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
from collections.abc import Callable, Sequence
from functools import wraps
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

STAGES: dict[str, Sequence[str]] = {  # of several names, those that the checkout has
    "derive": ("symgen.derive.derivation:derived",),
    "regroup": ("symgen.regroup.regrouping:regroup",),
    "values over F_p": ("symgen.regroup.states:sample", "symgen.regroup.residues:sample"),
    "rank over F_p": ("symgen.regroup.finite_field:rref", "symgen.regroup.finite_field:echelon"),
    "rewrite": ("symgen.emit.spec:module_spec",),
    "text": ("symgen.emit.generate:generate_files",),
    "certify formulas": ("symgen.certify.certificate:certify_formulas",),
    "Lagrange by CasADi": ("symgen.certify.lagrange:sampled", "symgen.derive.lagrange:sampled"),
    "certify text": ("symgen.certify.texts:text_check",),
}


class Clock:
    """Seconds and peak memory by stage; the stage at the top of `running` has the time."""

    def __init__(self) -> None:
        self.found: dict[str, list[float]] = {}
        self.running = ["other"]
        self.since = seconds()

    def turn(self) -> None:
        """Give the time since the last turn, and the peak, to the running stage."""
        now, peak = seconds(), peak_memory()
        spent, largest = self.found.get(self.running[-1], [0.0, 0.0])
        self.found[self.running[-1]] = [spent + now - self.since, max(largest, peak)]
        self.since = now

    def timed(self, stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def of_stage(*arguments: Any, **named: Any) -> Any:
            self.turn()
            self.running.append(stage)
            try:
                return function(*arguments, **named)
            finally:
                self.turn()
                self.running.pop()

        return of_stage


def seconds() -> float:
    """Processor seconds of this process and of those that it has started and that have ended."""
    used = [resource.getrusage(of) for of in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(x.ru_utime + x.ru_stime for x in used)


def peak_memory() -> float:
    """Largest resident set since the last call, MB."""
    status = Path("/proc/self/status").read_text()
    Path("/proc/self/clear_refs").write_text("5")
    (line,) = (line for line in status.splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) * 1024 / 1e6


def watch(clock: Clock) -> None:
    """Let the clock run in every stage, wherever a module of symgen has its function by name."""
    for stage, names in STAGES.items():
        for module, _, name in (text.partition(":") for text in names):
            if not all(find_spec(m) for m in (module.rpartition(".")[0], module)):
                continue
            if (function := getattr(import_module(module), name, None)) is None:
                continue
            timed = clock.timed(stage, function)
            for other in [m for key, m in sys.modules.items() if key.startswith("symgen.")]:
                for key, value in list(vars(other).items()):
                    if value is function:
                        setattr(other, key, timed)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("robot", type=Path)
    parser.add_argument("--target", default="numpy")
    parser.add_argument("-o", "--output", type=Path, default=Path("generated"))
    parser.add_argument("--root", type=Path, default=Path(__file__).parents[1])
    arguments = parser.parse_args()
    sys.path.insert(0, str(arguments.root))
    clock = Clock()
    modules = import_module("symgen.certify.modules")
    load_robot = import_module("symgen.description").load_robot
    arguments.output.mkdir(exist_ok=True)
    modules.stored_path = lambda file, text: arguments.output / file  # not into the cache
    watch(clock)
    files = modules.certified_files(
        load_robot(str(arguments.robot)), targets=tuple(arguments.target.split(","))
    )
    for file, text in files.items():
        (arguments.output / file).write_text(text, encoding="utf-8")
    clock.turn()
    found = json.dumps(clock.found)
    (arguments.output / "stages.json").write_text(found, encoding="utf-8")
    print(found)


if __name__ == "__main__":
    main()
