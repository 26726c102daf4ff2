"""The haptic interface of the chapter, section 4.2, from Table 5 to Tables 6 and 7 and to what the
user feels: `python haptic.py [FOLDER] [--quick]` prints the tables and writes the report.

No record of the interface is public. This one is SIMULATED, so that agreement says that the way
from positions and torques back to the parameters is unbiased, not that it agrees with the device.
"""

import sys
from dataclasses import replace
from pathlib import Path

import haptic_motion as motion
import numpy as np
from operational_space import felt_at_the_handle

import runtime
import symgen
from runtime.core.drives import Drives

# The chapter, Tables 6 and 7, its fC as FS: CAD (* from specific tests), identified, then %e at
# Delta = 2 pi/4000, 2 pi/100, 2 pi/80 of the motor.
PRINTED = """
ZZ1R       0.050   0.051    <1   1   4
MY1R       0.025   0.024    <1   2   6
FS1        0.12*    0.12    <1  <1   1
XX2R      -0.023  -0.023    <1   2   5
ZZ2R        0.03   0.029    <1   1   4
MX2R       -0.02  -0.019    <1   3   6
FS2R       0.11*    0.11    <1  <1  <1
OFFSET2     0.03   0.020    <1  <1   5
XX3R      -0.012  -0.011    <1   2   5
ZZ3R       0.014   0.014    <1  <1  <1
MX3R        0.04   0.039    <1  <1   2
MX5R        0.07   0.068    <1  <1   2
FS5R       0.11*    0.11    <1  <1  <1
OFFSET5     0.03   0.030    <1  <1  <1
"""
TABLE = {name: rest for name, *rest in map(str.split, PRINTED.split("\n")[1:-1])}
RESIDUAL = ("<1", "5", ">10")  # %e(rho) of Table 7
VERDICTS = ("practically unbiased", "small variations", "biased")  # section 4.2.2, at the steps
APPEARS = {"two-point": 100, "uniform": 100, "gaussian": 200}  # counts, section 4.2.3
MAIN = [name for name in TABLE if name[:2] in ("ZZ", "XX", "MX", "MY")]  # inertia and gravity
ONSET = 2 * np.pi / 200  # rad: where variations begin for the Gaussian distribution
RATIOS = (5.0, 20.0)  # other transmission ratios
ASSUMED = (
    "Given by the chapter and used as given: the table of frames, 4000 counts per motor "
    "revolution, Butterworth and decimation at 10 Hz, triangles at constant low speed and "
    "sinusoids, about 16000 rows, cond(W) near 150, five runs, steps 2 pi/4000, 2 pi/100 and 2 "
    "pi/80 of the motor positions.",
    "Assumed, since the chapter does not give it: all lengths, the direction of gravity, the "
    "double parallelogram as q4 = c - q5, the ratio of the cable transmissions (10), sampling at "
    f"{motion.RATE:g} Hz, white torque noise of {100 * motion.NOISE:g} % of the largest torque of "
    "each motor before the filters, the frequencies and amplitudes. Masses and inertias are one "
    "consistent set with the values of Table 6; what Table 6 leaves out is small there.",
    "Ratio and sampling rate were fixed first, before any figure of Table 7 was computed, and "
    "left alone since. The sinusoids were drawn for a small cond(W); the noise, and the size of "
    "what Table 6 leaves out, are such that the chapter's fourteen parameters are the essential "
    "ones: that count is put in, not found.",
    "The ratio decides how far a motor step moves the joint: %e depends on Delta divided by the "
    "ratio, and on the sampling rate, over which the filters average. The order of Table 7 is "
    "therefore met for this ratio and rate, not proved; the table of other ratios shows what "
    "others would give.",
)
DISTRIBUTIONS = (
    "Section 4.2.3: small variations appear at 2 pi/100 for the two-point and the uniform "
    "rounding, at 2 pi/200 for the Gaussian, which is therefore called pessimistic. The Gaussian "
    "and the two-point rounding have the same variance Delta^2, and through linear filters the "
    "same effect; the uniform one has a third of it. Here the first two come to about 1 % at 2 "
    "pi/200 alike; the difference the chapter saw is that of a limit just reached or missed.",
)


def main(folder: Path, quick: bool) -> None:
    """Identification, resolution, the handle. quick: a quarter of the record, two runs."""
    model = symgen.model("haptic")
    prepared = motion.prepare(model, motion.DURATION / (4 if quick else 1), 2 if quick else 5)
    print(prepared.note, file=sys.stderr)
    study, record = prepared.study, prepared.record
    result = runtime.identify(model, record, study)
    names = result.essential.names
    truth = dict(zip(model.BASE_PARAMETERS, model.base_parameters(model.VALUES), strict=True))

    def resolution(drives: Drives | None = None, **settings: object) -> runtime.Cestac:
        changed = replace(study, cestac=replace(study.cestac, **settings))
        motors = drives or record.origin.drives
        driven = replace(record, origin=replace(record.origin, drives=motors))
        return runtime.cestac(model, driven, changed, columns=names)

    deltas = (motion.DELTA[0], ONSET, *motion.DELTA[1:])
    roundings = {
        rounding: resolution(rounding=rounding, delta=deltas)
        for rounding in (["two-point"] if quick else APPEARS)
    }
    studied = roundings["two-point"]
    print(verdict(result.essential.estimate, studied, truth, len(result.estimate.names)))
    print("\nWhat is given and what is assumed", *ASSUMED, sep="\n\n")
    table_6(result, studied, truth)
    table_7(studied)
    if not quick:
        ratios = {
            ratio: resolution(Drives.from_mapping({"ratio": ratio * np.eye(3)})) for ratio in RATIOS
        }
        distributions(roundings, ratios)
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in prepared.files.items():
        (folder / name).write_bytes(content)
    files = tuple(str(folder / name) for name in prepared.files)
    study = replace(study, record=(replace(study.record[0], files=files),))
    told = replace(result, problem=result.problem.changed(settings=study))
    runtime.report(told.with_part(studied), folder)
    print("\nAt the handle: apparent mass, friction, stiffness\n")
    show(felt_at_the_handle(model, result.essential.estimate, folder / "handle.png"))
    print(f"\nreport: {folder / 'report.html'}")


def main_error(level, names):
    """%e and name of the main parameter, inertia or gravity, that changes most."""
    return max((float(level.e[names.index(n)]), n) for n in MAIN if n in names)


def judged(level, names):
    """Verdict as section 4.2.2 gives it, by the main parameters: limits 1 % and 5 %."""
    error, _ = main_error(level, names)
    return VERDICTS[(error >= 1) + (error > 5)]


def verdict(fit, studied, truth, count):
    """One sentence."""
    off = [abs(x - truth[n]) / s for n, x, s in zip(fit.names, fit.X, fit.sigma, strict=True)]
    steps = []
    for level in studied.levels:
        error, name = main_error(level, studied.names)
        steps.append(
            f"{judged(level, studied.names)} at {level.level.label} ({name} {error:.2g} %)"
        )
    return (
        f"SIMULATED record: {len(fit.names)} of {count} parameters leave {fit.relative_error:.1f} "
        f"% of the torques of haptic unexplained, the worst {max(off):.1f} standard deviations "
        "from what was put in; by the main inertia and gravity parameters least squares is "
        f"{'; '.join(steps)}."
    )


def table_6(result, studied, truth):
    """Least squares and the means of CESTAC at the real step, beside the chapter's columns."""
    fit, every, first = result.essential.estimate, result.estimate, studied.levels[0]
    ours = ("ours, LS", "error %", "%sigma", "error / sigma", f"CESTAC, {first.level.label}")
    rows = [("parameter", "CAD", "Table 6, LS", *ours)]
    for name, published in TABLE.items():
        cells = ["removed", "-", "-", "-", "-"]
        if name in fit.names:
            i, off = fit.names.index(name), fit[name] - truth[name]
            cells = [
                f"{fit[name]:.4g}",
                f"{100 * off / truth[name]:+.2f}",
                f"{fit.relative_sigma[i]:.2f}",
                f"{off / fit.sigma[i]:+.1f}",
                f"{first.mean[studied.names.index(name)]:.4g}",
            ]
        rows.append((name, *published[:2], *cells))
    z = abs(every.X - [truth[name] for name in every.names]) / every.sigma
    extra = [name for name in fit.names if name not in TABLE]
    print("\nTable 6: fourteen parameters, chapter and ours; SI units; * from specific tests")
    print(
        f"\nW has {every.rows} rows and {len(z)} columns, condition number {every.cond:.0f} "
        f"(chapter: 16000, 30, near 150). {len(fit.names)} parameters are essential (chapter: "
        f"14){', among them ' * bool(extra)}{', '.join(extra)}. With all {len(z)} fitted, "
        f"{sum(z <= 2)} lie within two and {sum(z <= 3)} within three standard deviations of what "
        "was put in. Sigma (10) takes the residuals of all joints as one white noise; here each "
        "joint has its own.\n"
    )
    show(rows)


def table_7(studied):
    """%e at the chapter's steps."""
    names = studied.names
    levels = [r for r in studied.levels if np.isclose(r.level.delta, motion.DELTA, 1e-9).any()]
    ours = {name: published[2:] for name, published in TABLE.items()}
    pairs = [("%e", [f"Table 7, {r.level.label}" for r in levels], ["ours"] * len(levels))]
    for name, published in ours.items():
        e = [f"{r.e[names.index(name)]:.2f}" if name in names else "-" for r in levels]
        pairs.append((name, published, e))
    pairs.append(("%e(rho), (22) as printed", RESIDUAL, [f"{r.e_rho:.2f}" for r in levels]))
    pairs.append(("verdict, main parameters", VERDICTS, [judged(r, names) for r in levels]))
    print("\nTable 7: encoder resolution, chapter and ours, %\n")
    print(*differences(levels, names), sep="\n\n", end="\n\n")
    show([(name, *(c for pair in zip(a, b, strict=True) for c in pair)) for name, a, b in pairs])


def differences(levels, names):
    """What differs from Table 7 and why."""

    def e(name, k):
        return f"{levels[k].e[names.index(name)]:.1f}" if name in names else "-"

    agree = tuple(judged(level, names) for level in levels) == VERDICTS
    worst = [main_error(level, names)[0] for level in levels]
    return (
        (
            "Order and verdicts are those of the chapter: "
            if agree
            else "Verdicts differ from the chapter's: "
        )
        + f"{worst[0]:.2f} % at 2 pi/4000 (chapter below 1 %), "
        f"{worst[1]:.1f} % at most among the main inertia and gravity parameters at 2 pi/100 "
        f"(chapter 3 %), {worst[2]:.1f} % at 2 pi/80 (chapter 6 %); dry friction does not move; "
        f"the residual grows by {levels[1].e_rho:.1f} and {levels[2].e_rho:.1f} % (chapter 5 and "
        "more than 10 %).",
        "Growth. Every bias here grows as Delta^2, as theory says: from 2 pi/100 to 2 pi/80 by "
        "1.56. Table 7 prints growth by 2 to 4 for ZZ1R, MY1R, XX2R, ZZ2R, MX2R and XX3R, and "
        "from below 1 to 5 % for OFFSET2. No linear filter of white rounding noise gives that; "
        "with five runs and rounding to whole per cents some of it is scatter.",
        f"Which parameters move. Here ZZ3R moves most ({e('ZZ3R', 1)} and {e('ZZ3R', 2)} %), "
        f"where Table 7 has less than 1 %, and MY1R stays ({e('MY1R', 2)} %), where it has 6 %. "
        "That is decided by how fast each joint was moved and how far it turned against gravity, "
        "which the chapter does not give; here joint 5 is the slowest.",
        f"Offsets. OFFSET2 and OFFSET5 move by {e('OFFSET2', 2)} and {e('OFFSET5', 2)} % at 2 "
        "pi/80 (chapter 5 % and below 1 %): they are the smallest torques and take up what MX2R "
        "and MX5R lose, since the mean posture here does not balance gravity. They are neither "
        "main inertia nor main gravity parameters and do not enter the verdict of this section; "
        "the stricter verdict of the complete study below counts them.",
        (
            "%e(rho) is eq. (22) as printed, with the measured W: on this record, whose residual "
            "is mostly torque noise, it has the order of Table 7."
        ),
    )


def distributions(roundings, ratios):
    """Where small variations appear for each distribution, and what other ratios would give."""

    def errors(result):
        worst = (main_error(r, result.names) for r in result.levels)
        return [f"{error:.2f} ({name})" for error, name in worst]

    def labels(result):
        return [r.level.label for r in result.levels]

    rows = [("distribution", "appear, chapter", "ours", *labels(roundings["two-point"]))]
    for rounding, result in roundings.items():
        onset = (r.level.label for r in result.levels if main_error(r, result.names)[0] >= 1)
        rows.append((rounding, f"2*pi/{APPEARS[rounding]}", next(onset, "-"), *errors(result)))
    print("\nDistributions and transmission ratios", *DISTRIBUTIONS, sep="\n\n")
    print("\nLargest %e of the main parameters; small variations: 1 % and more\n")
    show(rows)
    print("\nOther transmission ratios, two-point: largest %e\n")
    head = ("ratio", *labels(next(iter(ratios.values()))))
    show([head, *((f"{ratio:g}", *errors(result)) for ratio, result in ratios.items())])


def show(rows):
    """Columns of text, the first to the left."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for name, *cells in rows:
        padded = (cell.rjust(width) for cell, width in zip(cells, widths[1:], strict=True))
        print("  ".join([name.ljust(widths[0]), *padded]))


if __name__ == "__main__":
    folders = [Path(text) for text in sys.argv[1:] if text != "--quick"]
    main(folders[0] if folders else Path("haptic"), "--quick" in sys.argv)
