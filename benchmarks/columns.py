"""Laws of columns with known truth, and on measured records.

    python benchmarks/columns.py truth --records 400      # bias, scatter, coverage; pinocchio
    python benchmarks/columns.py loaded --records 400     # the same of friction by the load
    python benchmarks/columns.py measured                 # TX40, EMPS, KR300: do laws earn anything
    python benchmarks/columns.py kr300                    # the counterbalance as columns and as a law

`truth`: rigid-body torques by pinocchio, friction and cogging written here in NumPy, white noise of
2 % of the torques' deviation; the same motion, other noise in every record. Coverage is that of
1.96 deviations, its standard error sqrt(0.95 0.05/N).
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import kr300

import runtime
import symgen
from oracles.pinocchio_model import PinocchioModel
from runtime.compose import estimate_of, problem
from runtime.laws.scalars import fit_laws
from runtime.reading.datasets import dataset_study
from runtime.reading.records import read_records
from runtime.study import study_from_mapping
from symgen.description.element import LawScalar
from symgen.description.expression import ONE
from symgen.description.grammar import LAWS, parse
from symgen.description.robot import Element

PLAIN = study_from_mapping(
    {"signals": {"median": 1, "lowpass": None, "decimate": None}, "rows": {"trim": 3}}
)
RATE, SECONDS, NOISE = 250.0, 24.0, 0.02
LOAD = 0.15  # friction per transmitted torque
TRUE = {"stribeck": {"vs": 0.08}, "tanh": {"vs": 0.05}, "cogging": {"phase": 0.7}}
FIT = {
    "stribeck": {"vs": LawScalar((0.01, 1.0))},
    "tanh": {"vs": LawScalar((0.005, 1.0))},
    "cogging": {"order": LawScalar((9.0, 9.0)), "phase": LawScalar((-1.5, 2.5))},
}


def with_law(robot, kind, joints, family="LAW", **given):
    """The robot with a law along each of some joints, and friction and offset on all of them."""
    everywhere = {j: {j: ONE} for j in robot.joints}
    own = [e for e in robot.elements if e.family not in ("FV", "FS", "OFFSET")]
    usual = [
        Element(family_, kind_, everywhere, {})
        for family_, kind_ in (("FV", "viscous"), ("FS", "coulomb"), ("OFFSET", "offset"))
    ]
    along = {j: {j: ONE} for j in joints}
    law = [Element(family, kind, along, {}, **given)] if kind else []
    return replace(robot, elements=(*own, *usual, *law))


def motion(n, seed):
    rng, t = np.random.default_rng(seed), np.arange(int(RATE * SECONDS)) / RATE
    q = np.zeros((3, len(t), n))
    for j in range(n):
        for k, w in enumerate(2 * np.pi * np.array([1, 3, 7, 13]) / SECONDS):
            a, phase = 0.4 / (k + 1), rng.uniform(0, 2 * np.pi)
            q[0, :, j] += a * np.sin(w * t + phase)
            q[1, :, j] += a * w * np.cos(w * t + phase)
            q[2, :, j] -= a * w**2 * np.sin(w * t + phase)
    return t, q


def law_torque(kind, q, qd):
    if kind == "stribeck":
        return np.sign(qd) * np.exp(-((qd / 0.08) ** 2))
    return np.tanh(qd / 0.05) if kind == "tanh" else np.sin(9 * q + 0.7)


def truth(records, kinds, robots):
    print("| robot | law | quantity | true | mean | bias/scatter | scatter | stated | coverage % |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in robots:
        for kind in kinds:
            started = time.time()
            plain = with_law(symgen.load_robot(name), "", ())
            joints = plain.joints[:2]
            robot = with_law(plain, kind, joints, fit=FIT[kind])
            model, without = symgen.model(robot), symgen.model(plain)
            t, (q, qd, qdd) = motion(len(robot.joints), 7)
            oracle = PinocchioModel(plain)
            rng = np.random.default_rng(3)
            chi = {p: rng.uniform(0.2, 1.0) for p in plain.parameters}
            chi |= {f"FS{j}": 2.0 for j in joints} | {f"FV{j}": 1.0 for j in joints}
            vector = np.array([chi[p] for p in plain.parameters])
            tau = np.array([oracle.regressor(*s) @ vector for s in zip(q, qd, qdd, strict=True)])
            columns = [plain.joints.index(j) for j in joints]
            tau[:, columns] += 1.0 * law_torque(kind, q[:, columns], qd[:, columns])
            noise = NOISE * tau.std(axis=0)
            bare = (
                problem(without, runtime.Record(t, q, tau, rate=RATE), PLAIN)
                .prepared[0]
                .observation(without)
            )
            sigma = noise[bare.joints]
            j = joints[0]
            scalar = next(s for s in model.FIT if s.endswith(str(j)))
            told = {scalar: TRUE[kind][scalar.rstrip("0123456789")], f"LAW{j}": 1.0}
            found = {key: [] for key in told}
            usual = {f"FS{j}": [], f"FV{j}": []}
            pseudo = np.linalg.pinv(bare.W / sigma[:, None])
            for k in range(records):
                noisy = tau + noise * np.random.default_rng([k, 5]).standard_normal(tau.shape)
                own = problem(model, runtime.Record(t, q, noisy, rate=RATE), PLAIN).prepared[0]
                fit = fit_laws(model, [own], weights=True)
                s = next(x for x in fit.scalars if x.name == scalar)
                test = next(x for x in fit.tests if x.parameter == f"LAW{j}")
                found[scalar].append((s.value, s.sigma))
                found[f"LAW{j}"].append((test.value, test.sigma))
                X = pseudo @ (own.observation(without).Y / sigma)
                for key, values in usual.items():
                    values.append(X[bare.names.index(key)])
            for key, true in told.items():
                x, deviation = np.array(found[key]).T
                scatter = x.std(ddof=1)
                covered = 100 * np.mean(np.abs(x - true) < 1.96 * deviation)
                print(
                    f"| {name} | {kind} | {key} | {true:g} | {x.mean():.4f} | "
                    f"{(x.mean() - true) / scatter:+.2f} | {scatter:.4f} | "
                    f"{np.sqrt(np.mean(deviation**2)):.4f} | {covered:.1f} |",
                    flush=True,
                )
            for key, x in usual.items():
                bias, scatter = np.mean(x) - chi[key], np.std(x, ddof=1)
                print(
                    f"| {name} | {kind} left out | {key} | {chi[key]:g} | {np.mean(x):.4f} | "
                    f"{bias / scatter:+.1f} | {scatter:.4f} | | |",
                    flush=True,
                )
            print(f"<!-- {records} records, {time.time() - started:.0f} s -->", flush=True)


def loaded(records, robots):
    """Friction in proportion to the transmitted torque: by the torque of the model, and by the
    measured one.
    """
    print(
        "| robot | torque | quantity | true | mean | bias/scatter | scatter | stated | coverage % |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    study = replace(PLAIN, estimate=replace(PLAIN.estimate, method="wls", weights="joint"))
    for name in robots:
        plain = with_law(symgen.load_robot(name), "", ())
        joints = plain.joints[:2]
        model = symgen.model(with_law(plain, "load_dependent", joints))
        t, (q, qd, qdd) = motion(len(plain.joints), 7)
        rng = np.random.default_rng(3)
        chi = {p: rng.uniform(0.2, 1.0) for p in plain.parameters}
        chi |= {f"FS{j}": 2.0 for j in joints} | {f"FV{j}": 1.0 for j in joints}
        vector, oracle = np.array([chi[p] for p in plain.parameters]), PinocchioModel(plain)
        tau = np.array([oracle.regressor(*s) @ vector for s in zip(q, qd, qdd, strict=True)])
        k = [plain.joints.index(j) for j in joints]
        tau[:, k] += LOAD * np.abs(tau[:, k]) * np.sign(qd[:, k])
        true = {f"LAW{joints[0]}": LOAD, f"FS{joints[0]}": 2.0, f"FV{joints[0]}": 1.0}
        found = {(way, key): [] for way in ("of the model", "measured") for key in true}
        refused = 0
        for number in range(records):
            noise = (
                NOISE
                * tau.std(axis=0)
                * np.random.default_rng([number, 5]).standard_normal(tau.shape)
            )
            record = runtime.Record(t, q, tau + noise, rate=RATE)
            channels = {f"tau_model{j}": record.tau[:, i] for j, i in zip(joints, k, strict=True)}
            own = {
                "measured": problem(model, replace(record, channels=channels), study).prepared[0]
            }
            try:
                own["of the model"] = problem(model, record, study).prepared[0]
            except runtime.InputError:
                refused += 1
            for way, one in own.items():
                fit = estimate_of(one.observation(model), study.estimate, model=model)
                for key in true:
                    at = fit.names.index(key) if key in fit.names else None
                    if at is not None and np.isfinite(fit.sigma_corrected[at]):
                        found[way, key].append((fit.X[at], fit.sigma_corrected[at]))
        for (way, key), values in found.items():
            if len(values) < records / 2:
                print(f"| {name} | {way} | {key} | {true[key]:g} | not determined | | | | |")
                continue
            x, deviation = np.array(values).T
            scatter = x.std(ddof=1)
            covered = 100 * np.mean(np.abs(x - true[key]) < 1.96 * deviation)
            print(
                f"| {name} | {way} | {key} | {true[key]:g} | {x.mean():.4f} | "
                f"{(x.mean() - true[key]) / scatter:+.2f} | {scatter:.4f} | "
                f"{np.sqrt(np.mean(deviation**2)):.4f} | {covered:.1f} |"
            )
        print(
            f"<!-- {records} records, {refused} whose torque of the model does not settle -->",
            flush=True,
        )


def sources():
    """(name, robot, study)."""
    for name in ("emps", "tx40"):
        yield name, symgen.load_robot(name), study_from_mapping(dataset_study(name))
    yield "kr300", symgen.load_robot(kr300.DATA / "kr300.yaml"), study_from_mapping(kr300.study())


def measured(kinds=("stribeck", "tanh", "cubic", "sigmoid"), records=("emps", "kr300", "tx40")):
    print(
        "| record | law | joint | value | p | unseen without % | unseen with % | scalars | earned |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for name, robot, study in (own for own in sources() if own[0] in records):
        for kind in kinds:
            law = Element("LAW", kind, {j: {j: ONE} for j in robot.joints}, {})
            bent = replace(robot, elements=(*robot.elements, law))
            if kind == "cubic":  # no scalar: one that changes nothing beside it carries the test
                law = Element(
                    "LAW", "column", {j: {j: ONE} for j in robot.joints}, {},
                    unit="N*m", torque=parse("sign(qd)*abs(qd)**delta", None, LAWS),
                    fit={"delta": LawScalar((1.2, 4.0))},
                )  # fmt: skip
                bent, kind = replace(robot, elements=(*robot.elements, law)), "power"
            model = symgen.model(bent)
            records = read_records(study.record, model)
            fit = fit_laws(
                model, [problem(model, r, study).prepared[0] for r in records], weights=True
            )
            for test in fit.tests:
                said = ", ".join(
                    s.doubt or f"{s.name} {s.value:.3g} ± {s.sigma:.1g}"
                    for s in fit.scalars
                    if s.parameter == test.parameter
                )
                print(
                    f"| {name} | {kind} | {test.parameter[3:]} | {test.value:.3g} ± {test.sigma:.1g} | "
                    f"{test.p_value:.1g} | {test.without:.3f} | {test.with_law:.3f} | {said} | "
                    f"{'yes' if test.earned else 'no'} |",
                    flush=True,
                )


LENGTH = "sqrt(0.68 - 0.32*cos(q + phi))"
CYLINDER = f"0.16*sin(q + phi)/{LENGTH}*AREA*PRESSURE/(0.00096 - ({LENGTH} - 0.6)*AREA)"


def counterbalance():
    robot = symgen.load_robot(kr300.DATA / "kr300.yaml")
    area, pressure = np.pi * (0.055**2 - 0.030**2) / 4, 1.01 * 296.8 * 328 * 0.159
    along, constants = {2: {2: ONE}}, {**robot.constants, "AREA": area, "PRESSURE": pressure}

    def column(family, law, **given):
        return Element(
            family, "column", along, {}, unit="N*m", torque=parse(law, None, LAWS), **given
        )

    anchor = {"phi": LawScalar((-0.6, 0.8), float(np.radians(5)))}
    models = {
        "without it": robot,
        "a + b sin q2 + c cos q2": replace(
            robot, elements=(*robot.elements, column("CBS", "sin(q)"), column("CBC", "cos(q)"))
        ),
        "law, anchor fitted": replace(
            robot,
            constants=constants,
            elements=(*robot.elements, column("CB", CYLINDER, fit=anchor)),
        ),
        "law, anchor of the source": replace(
            robot,
            constants=constants,
            elements=(
                *robot.elements,
                column("CB", CYLINDER, fit={"phi": LawScalar((float(np.radians(5)),) * 2)}),
            ),
        ),
    }
    CAD = {load: kr300.values(load) for load in (150.0, 200.0)}
    print(
        "| counterbalance | parameters | error A % | error B % | MX2R, kg m | column | anchor, deg |"
    )
    print("|---|---|---|---|---|---|---|")
    for name, own in models.items():
        model, study = symgen.model(own), study_from_mapping(kr300.study(validate="B"))
        A = read_records(study.record, model)
        result = runtime.identify(model, A, study)
        fit, B = result.estimate, result.validation[-1]
        k = fit.names.index("MX2R") if "MX2R" in fit.names else None
        value = "" if k is None else f"{fit.X[k]:.0f} ± {1.96 * fit.sigma_corrected[k]:.0f}"
        own_names = [n for n in fit.names if n.startswith("CB")]
        values = ", ".join(
            f"{n} {fit[n]:.4g} ± {1.96 * fit.sigma_corrected[fit.names.index(n)]:.2g}"
            for n in own_names
        )
        phi = (
            ""
            if result.part("laws") is None
            else ", ".join(
                s.doubt or f"{np.degrees(s.value):.2f} ± {1.96 * np.degrees(s.sigma):.2f}"
                for s in result.part("laws").scalars
            )
        )
        unseen = {key: round(x, 2) for key, x in B.errors().items()}
        print(
            f"| {name} | {len(fit.names)} | {fit.relative_error:.2f} | {unseen} | {value} | "
            f"{values} | {phi} |",
            flush=True,
        )
    for load, standard in CAD.items():
        model = symgen.model(robot)
        X = dict(zip(model.BASE_PARAMETERS, model.base_parameters(standard), strict=True))
        print(f"<!-- MX2R of CAD with {load:g} kg: {X['MX2R']:.0f} kg m -->")


if __name__ == "__main__":
    arguments = argparse.ArgumentParser()
    arguments.add_argument("what", choices=["truth", "loaded", "measured", "kr300"])
    arguments.add_argument("--records", type=int, default=400)
    arguments.add_argument("--kinds", nargs="*", default=["stribeck", "tanh", "cogging"])
    arguments.add_argument("--robots", nargs="*", default=["emps", "planar_2r", "scara"])
    given = arguments.parse_args()
    if given.what == "truth":
        truth(given.records, given.kinds, given.robots)
    elif given.what == "loaded":
        loaded(given.records, given.robots)
    elif given.what == "measured":
        measured()
    else:
        counterbalance()
