"""`symgen simulate ROBOT STUDY`: the closed loop of a study file, from a reference to a record."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from runtime.result_files import reserved
from symgen.cli.session import SIMULATED, fail, opened_model, reported_errors, single_thread, study_text, symbolic_file

if TYPE_CHECKING:
    import numpy as np

    from runtime.model.generated import GeneratedModel
    from runtime.motion.result import Simulation
    from runtime.settings.study import Study

RECORD = "simulated.csv"


def simulate(
    robot: Annotated[str, typer.Argument(help="Packaged robot, robot file (.yaml, .par, .urdf) or generated module (.py).")],
    study: Annotated[str, typer.Argument(help="Study file with a section `controller`, or a dataset that has one.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help=f"Folder for {RECORD}, study.yaml, simulation.json and the figure.")
    ] = None,
    ideal: Annotated[bool, typer.Option("--ideal", help="No noise, no steps of encoder and converter.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print simulation.json instead of a table.")] = False,
) -> None:
    """Simulate ROBOT under the controller of STUDY. Parameters are the values of the robot file, or those of `controller.values`.

    The record is written as `identify` reads it, with the reference in columns qr1 ...; study.yaml names it.
    """
    single_thread()
    with reported_errors(), reserved(output) as results, opened_model(robot) as model:
        from runtime.estimators.estimate import json_text
        from runtime.model.casadi import load_symbolic
        from runtime.motion.reference import reference_of
        from runtime.motion.simulation import Simulator, parameters_of
        from runtime.records.named import study_of
        from runtime.records.reading import read_records

        settings, folder = study_of(study)
        controller = settings.controller
        if controller is None:
            fail(f"{study} has no section `controller`; it says law, rate and reference of the closed loop")
        X = parameters_of(model, controller)
        records = read_records(settings.record, model, folder=folder) if controller.reference.record is not None else []
        reference = reference_of(controller, model, records=records, folder=folder)
        simulator = Simulator(model, controller, symbolic=load_symbolic(symbolic_file(robot, model), of=model))
        start = records[controller.reference.record].q[0] if controller.reference.record is not None and controller.start is None else None
        found = simulator.run(X, reference, ideal=ideal, start=start, name=f"{SIMULATED} {model.NAME}")
        summary = summary_of(model, found, X, ideal=ideal)
        if results is not None:
            results.write_all(simulation_files(model, found, summary, settings, results.folder))
        typer.echo(json_text(summary) if json else console_text(model, found), nl=not json)


def summary_of(model: GeneratedModel, found: Simulation, X: np.ndarray, *, ideal: bool) -> dict[str, Any]:
    """simulation.json."""
    import numpy as np

    from runtime.motion.dry_friction import REST

    error = found.q - found.q_r
    return {
        "robot": model.NAME,
        "source_sha256": model.SOURCE_SHA256,
        "note": "SIMULATED: nothing was measured",
        "ideal": ideal,
        "rate": found.rate,
        "samples": len(found.t),
        "substeps": found.substeps,
        "joints": list(model.JOINTS),
        "tracking_error": {"rms": np.sqrt((error**2).mean(axis=0)).tolist(), "max": np.abs(error).max(axis=0).tolist()},
        "torque": {"rms": np.sqrt((found.tau**2).mean(axis=0)).tolist(), "max": np.abs(found.tau).max(axis=0).tolist()},
        "saturated": found.saturated.tolist(),
        "at_rest": (np.abs(found.qd) <= REST).mean(axis=0).tolist(),
        "parameters": dict(zip(model.BASE_PARAMETERS, X.tolist(), strict=True)),
    }


def simulation_files(
    model: GeneratedModel, found: Simulation, summary: dict[str, Any], study: Study, output: Path
) -> dict[str, str | bytes]:
    """Contents of the output folder: the record, a study that reads it back, figures of merit, the figure."""
    from dataclasses import replace

    from runtime.estimators.estimate import json_text
    from runtime.reporting.figures import png, svg
    from runtime.reporting.simulation import simulation_figure
    from runtime.settings.study import RecordSettings

    figure = simulation_figure(model.JOINTS, found, units(model))
    record = RecordSettings(files=(RECORD,), rate=found.rate, name=found.name)
    return {
        RECORD: found.to_csv(),
        "study.yaml": study_text(replace(study, record=(record,)), output, output),
        "simulation.json": json_text(summary),
        "simulation.svg": svg(figure),
        "simulation.png": png(figure),
    }


def units(model: GeneratedModel) -> list[tuple[str, str]]:
    """Units of position and torque of each joint: that of a prismatic one from its friction or mass."""
    found = []
    for row in range(len(model.JOINTS)):
        own = [name for k, name in enumerate(model.BASE_PARAMETERS) if model.STRUCTURE[k, row]]
        slides = any(model.UNITS[name] in ("N", "N*s/m") for name in own)  # type: ignore[attr-defined]
        found.append(("m", "N") if slides else ("rad", "N m"))
    return found


def console_text(model: GeneratedModel, found: Simulation) -> str:
    """Tracking error and torque of each joint."""
    import numpy as np

    from runtime.motion.dry_friction import REST

    error = np.abs(found.q - found.q_r)
    lines = [
        f"{len(found.t)} samples at {found.rate:g} Hz, {found.substeps} integration step{'s' * (found.substeps > 1)} per tick; nothing was measured"
    ]
    lines.append(f"{'joint':>5}  {'rms error':>10}  {'max error':>10}  {'max torque':>10}  {'saturated':>9}  {'at rest':>8}")
    for row, (j, (position, torque)) in enumerate(zip(model.JOINTS, units(model), strict=True)):
        rms, largest, effort = np.sqrt((error[:, row] ** 2).mean()), error[:, row].max(), np.abs(found.tau[:, row]).max()
        share = f"{100 * found.saturated[row]:>7.2f} %  {100 * (np.abs(found.qd[:, row]) <= REST).mean():>6.2f} %"
        lines.append(f"{j:>5}  {rms:>10.3g}  {largest:>10.3g}  {effort:>10.4g}  {share}   ({position}, {torque})")
    return "\n".join(lines)
