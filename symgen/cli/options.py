"""Arguments and options of the commands that several commands share or whose help is long."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

Text = str | None


def folder(files: str) -> Any:
    """Make the option -o of a command; `files` names the written files in the help text."""
    return output(f"Folder for {files}.")


def output(text: str) -> Any:
    """Make the option -o of a command with the help `text`.

    An empty -o is refused: it would mean the folder where one stands.
    """
    return typer.Option("-o", "--output", parser=_place, metavar="PATH", help=text)


def _place(given: str | Path) -> Path:
    if not str(given):
        raise typer.BadParameter("-o is empty; name a folder or file, or leave out -o")
    return Path(given)


RobotFile = Annotated[
    str, typer.Argument(help="Packaged robot or robot file (.yaml, .par, .urdf, .xml, .mjcf).")
]
RobotOrModule = Annotated[
    str,
    typer.Argument(
        help="Packaged robot, robot file (.yaml, .par, .urdf, .xml, .mjcf) or generated module (.py)."
    ),
]
Records = Annotated[
    list[str],
    typer.Argument(
        help="Dataset, study file (.yaml) or measured file (columns t, q1 .., tau1 ..; SI, joint side). "
        "Several measured files are several records, fitted together."
    ),
]
AtValues = Annotated[
    bool,
    typer.Option(
        "--at-values",
        help="Use the numbers of the constants instead of symbols. The base parameters and formulas then hold for these numbers only.",
    ),
]
Exact = Annotated[
    bool,
    typer.Option(
        "--exact",
        help="Use the angles of a URDF, MJCF or .par file exactly as written. Without it, an angle within "
        "1e-4 rad of a multiple of pi/12 is replaced by that multiple.",
    ),
]
Base = Annotated[
    Text,
    typer.Option(
        "--base",
        help="Base of the robot. fixed: frame 0 stands still. moving: the motion of frame 0 is measured. free: the motion of frame 0 and the wrench on it are measured. Default: the base in the robot file.",
    ),
]
Trust = Annotated[
    bool,
    typer.Option(
        "--trust",
        help="Run a generated module (.py) that was not made on this machine. Such a module is a "
        "program: use this option only if you trust its author.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Columns = Annotated[
    Text,
    typer.Option(help="Parameters to use: essential, all, or names separated by commas."),
]
Seed = Annotated[int | None, typer.Option(help="Seed of the random numbers.")]
Workers = Annotated[
    int,
    typer.Option(
        min=0,
        help="Number of worker processes; 0 or 1 runs in this process. The results do not depend "
        "on this number.",
    ),
]
Side = Annotated[
    Text,
    typer.Option(help="Side on which positions are rounded, as an encoder does: joint or motor."),
]
Rounding = Annotated[
    Text,
    typer.Option(
        help="How positions are rounded: two-point (up or down by one step at random), "
        "uniform, gaussian, quantise, or phase (a real encoder with a random zero in each run)."
    ),
]
Uneven = Annotated[
    float | None,
    typer.Option(
        help="Standard deviation of the spacing of the encoder lines, in steps, such as 0.1; "
        "only with --rounding phase."
    ),
]
Method = Annotated[
    Text,
    typer.Option(
        help="Estimator to use instead of that of the study: ols, wls, irls, iv, didim, feasible."
    ),
]
Reader = Annotated[
    Text,
    typer.Option(
        help="How velocities are computed: `lowpass`, by filtering the positions; `counts`, by estimating the motion from "
        "encoder counts (needs --rounding phase)."
    ),
]
Place = Annotated[
    Text,
    typer.Option(
        help="What is rounded: the recorded positions (record), or the encoder signal in a simulation of "
        "the closed loop of the study (loop)."
    ),
]
Advise = Annotated[
    bool,
    typer.Option(
        "--advise",
        help="Predict the coarsest encoder steps that change the parameters by less than 1 % and 5 %, "
        "and confirm each with --runs runs.",
    ),
]
Lock = Annotated[
    list[str] | None,
    typer.Option(
        help="URDF or MJCF only: lock a joint at a position, e.g. elbow=pi/2 (rad or m). Repeat "
        "the option for several joints."
    ),
]
Chain = Annotated[
    tuple[str, str] | None,
    typer.Option(
        metavar="BASE TIP",
        help="URDF or MJCF only: keep the joints between two links and lock all others at zero.",
    ),
]
At = Annotated[
    Text,
    typer.Option(
        help="Link of the robot file at which mass, centre and inertia of the load of the study are given, "
        "such as tool0. Default: tool0, flange or the last link that the load can be mounted on."
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Replace the file if it exists.")]
