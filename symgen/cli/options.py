"""Arguments and options of the verbs, those that several have or whose help is long."""

from __future__ import annotations

from typing import Annotated, Any

import typer

Text = str | None


def folder(files: str) -> Any:
    """The option -o of a verb that writes these files."""
    return typer.Option("-o", "--output", help=f"Folder for {files}.")


RobotFile = Annotated[
    str, typer.Argument(help="Packaged robot or robot file (.yaml, .par, .urdf, .xml, .mjcf).")
]
RobotOrModule = Annotated[
    str,
    typer.Argument(
        help="Packaged robot, robot file (.yaml, .par, .urdf) or generated module (.py)."
    ),
]
Records = Annotated[
    list[str],
    typer.Argument(
        help="Dataset, study file (.yaml) or measured file (t,q1..,tau1..; SI, joint side). "
        "Further measured files like the first: records of their own."
    ),
]
AtValues = Annotated[
    bool,
    typer.Option(
        "--at-values",
        help="Replace every constant by its number. The base parameters and formulas then hold for these values only.",
    ),
]
Exact = Annotated[
    bool,
    typer.Option(
        "--exact",
        help="Take the angles of a URDF, MJCF or .par file as they are written. Otherwise an angle within "
        "1e-4 rad of a multiple of pi/12 is taken as that multiple.",
    ),
]
Trust = Annotated[
    bool,
    typer.Option(
        "--trust",
        help="Run a generated module (.py) that was not emitted on this machine. It is code: use only what you trust.",
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
        help="Number of worker processes; 0 or 1 runs in this process. The results do not depend on it.",
    ),
]
Scheduler = Annotated[
    Text,
    typer.Option(
        help="Address of a Dask scheduler whose workers do the work, such as tcp://10.0.0.1:8786."
    ),
]
Side = Annotated[Text, typer.Option(help="joint or motor: where positions are rounded.")]
Rounding = Annotated[
    Text,
    typer.Option(
        help="How positions are rounded: two-point, uniform, gaussian, quantise, or phase (the counts of "
        "a real encoder whose lines start at random)."
    ),
]
Uneven = Annotated[
    float | None,
    typer.Option(
        help="How unevenly the encoder's lines are spaced, as a standard deviation in steps, such as 0.1; "
        "with --rounding phase."
    ),
]
Method = Annotated[
    Text,
    typer.Option(help="Estimator in place of the study's: ols, wls, irls, iv, didim, feasible."),
]
Reader = Annotated[
    Text,
    typer.Option(
        help="How positions become velocities: lowpass filters them as they are; counts reads them as "
        "encoder counts (with --rounding phase)."
    ),
]
Place = Annotated[
    Text,
    typer.Option(
        help="record: recorded positions are rounded; loop: the encoder of the study's closed "
        "loop, in every run."
    ),
]
Advise = Annotated[
    bool,
    typer.Option(
        "--advise",
        help="Predict the coarsest steps that keep the change below 1 % and 5 %, and confirm them "
        "by --runs runs each.",
    ),
]
Lock = Annotated[
    list[str] | None,
    typer.Option(
        help="URDF or MJCF only: lock a joint at a position, e.g. elbow=pi/2 (rad or m); may be repeated."
    ),
]
Chain = Annotated[
    tuple[str, str] | None,
    typer.Option(
        metavar="BASE TIP",
        help="URDF or MJCF only: keep the joints between two links and lock all others at zero.",
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Replace the file if it exists.")]
