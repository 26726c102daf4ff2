"""Coarse encoders made fine: the TX40 record at steps of 2 pi/5000 to 2 pi/100, read as positions
and read as counts: `python coarse_encoders.py [FOLDER] [--quick]` prints the table and writes the
report of the reader of counts. The record is measured, or else simulated.

The encoders are those of the record made coarser: every position becomes the nearest of the points
phi + k Delta, phi random for each joint and run, as a real encoder has it. Torques are as recorded.
Then both ways of reading:

As positions, the usual way: counts times step, low-pass, two differences, least squares. The error
of a count is taken for white noise. Its cut-off is that of the chapter, 50 Hz, and beside it the
best of TUNED, chosen level by level by the error itself, which no one knows who has coarse counts
alone: the fairest opponent of the counts, and the first thing to try.

As counts: at every sample the joint is within its interval, and it passed a known position when the
count changed. The smoothest motion between these bounds goes through the same filters; dry friction
depends on how sure the sign of a slow speed is.

%e is the change of a parameter from the estimate of the record as it is, the positions of which are
far finer than any of these steps. Nothing of the fine record is told to either reader.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import runtime
from symgen.demo import MAIN, changed, prepare

COUNTS = (5000, 2000, 1000, 500, 250, 100)  # steps a turn, at the joints
KEY = "ZZ1R"
READERS = ("lowpass", "counts")
TUNED = (5, 8, 12, 15, 20, 30)  # Hz
COLUMNS = ("rms %e", "largest %e", KEY)


def main(folder: Path, quick: bool) -> None:
    """Two studies of the same steps and draws. quick: every second step, two runs."""
    prepared = prepare(quick=quick)
    print(prepared.note, file=sys.stderr)
    model, record = prepared.model, prepared.record
    essential = runtime.essential(model, record, prepared.study).names
    steps = tuple(2 * np.pi / counts for counts in (COUNTS[::2] if quick else COUNTS))
    study = changed(prepared.study, "cestac", delta=steps, runs=2 if quick else 3, rounding="phase")
    studies = {reader: changed(study, "signals", reader=reader) for reader in READERS}
    results = [runtime.cestac(model, record, one, columns=essential) for one in studies.values()]
    names = [name for name in MAIN if name in results[1].names]
    labels = [level.level.label for level in results[1].levels]
    positions, counts = (columns(result, names) for result in results)
    tuned = best(model, record, studies["lowpass"], essential, names, results[0])
    k, truth = min(2, len(steps) - 1), results[1].reference[KEY]
    print(
        f"{'SIMULATED record: ' if prepared.note else ''}with encoder steps of {labels[k]} at the "
        f"joints of {model.NAME}, {len(names)} main parameters change by {positions[k][0]:.1f} % "
        f"rms read as positions, {tuned[k][0]:.1f} % by the best cut-off, and by "
        f"{counts[k][0]:.1f} % read as counts; {KEY} is {positions[k][2]:.3f}, "
        f"{tuned[k][2]:.3f} and {counts[k][2]:.3f}, {truth:.3f} from the record as it is.\n"
    )
    ways = ("positions", "best cut-off", "counts")
    head = ("step", *(f"{name}: {what}" for name in ways for what in COLUMNS))
    cells = [
        (label, *(f"{x:.{digits}f}" for x, digits in zip((*a, *b, *c), (1, 1, 3) * 3, strict=True)))
        for label, a, b, c in zip(labels, positions, tuned, counts, strict=True)
    ]
    text = "\n".join("  ".join(cell.rjust(22) for cell in row) for row in [head, *cells])
    print(text)
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in prepared.files.items():
        (folder / name).write_bytes(content)
    files = tuple(str(folder / name) for name in prepared.files) or study.record[0].files
    settings = (replace(study.record[0], files=files),)
    runtime.report(results[1], folder, study=replace(studies["counts"], record=settings))
    (folder / "positions.json").write_text(results[0].to_json())
    (folder / "readers.txt").write_text(text + "\n")
    draw(steps, labels, (positions, tuned, counts), truth, folder / "counts")
    print(f"\nreport: {folder / 'report.html'}")


def columns(result: runtime.Cestac, names: list[str]) -> list[tuple[float, float, float]]:
    """COLUMNS by level."""
    k = [result.names.index(name) for name in names]
    return [
        (np.sqrt(np.mean(level.e[k] ** 2)), level.e[k].max(), level.mean[result.names.index(KEY)])
        for level in result.levels
    ]


def best(model, record, study, essential, names, usual) -> list[tuple[float, float, float]]:
    """COLUMNS by level at the best of TUNED and the cut-off of the study; changes are those from
    the estimate of the record as it is at the cut-off of the study.
    """
    low = study.signals.lowpass
    studies = [changed(study, "signals", lowpass=replace(low, cutoff=cutoff)) for cutoff in TUNED]
    results = [usual, *(runtime.cestac(model, record, one, columns=essential) for one in studies)]
    exact = np.array([usual.reference[name] for name in names])
    found = []
    for levels in zip(*(result.levels for result in results), strict=True):
        means = [level.mean[[usual.names.index(name) for name in names]] for level in levels]
        errors = [100 * np.abs(mean / exact - 1) for mean in means]
        sizes = [float(np.sqrt(np.mean(e**2))) for e in errors]
        k = int(np.argmin(sizes))
        found.append((sizes[k], errors[k].max(), levels[k].mean[usual.names.index(KEY)]))
    return found


def draw(steps, labels, rows_by_way, truth, file: Path) -> None:
    """rms %e up to the largest, and the mean of KEY, against the step, by both readers."""
    figure = Figure((9.6, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    ways = (
        ("read as positions, 50 Hz", "tab:orange"),
        ("read as positions, best cut-off", "tab:green"),
        ("read as counts", "tab:blue"),
    )
    for rows, (label, color) in zip(rows_by_way, ways, strict=True):
        rms, largest, mean = np.array(rows).T
        left.plot(steps, rms, "o-", color=color, label=label)
        left.fill_between(steps, rms, largest, color=color, alpha=0.15, linewidth=0)
        right.plot(steps, mean, "o-", color=color)
    for limit in (1, 5):
        left.axhline(limit, color="black", linewidth=0.9, linestyle=":")
    right.axhline(truth, color="black", linewidth=0.9, linestyle="--", label="as recorded")
    left.set(yscale="log", ylabel="%e, rms; shaded: up to the largest")
    right.set(ylabel=f"{KEY}, kg m^2")
    for ax in (left, right):
        ax.set(xscale="log", xlabel="step of every encoder, rad")
        ax.set_xticks(steps, labels, rotation=30, ha="right")
        ax.minorticks_off()
        ax.legend()
    for ending in ("png", "svg"):
        figure.savefig(file.with_suffix(f".{ending}"))


if __name__ == "__main__":
    folders = [Path(text) for text in sys.argv[1:] if text != "--quick"]
    main(folders[0] if folders else Path("coarse-encoders"), "--quick" in sys.argv)
