"""The MATLAB files, run in Octave: agreement with NumPy on every packaged robot and every kind of law,
with pinocchio, refusals in one sentence, the language that MATLAB and Octave share.
"""

from __future__ import annotations

import re
import signal
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from campaign import campaign, sampled, some
from octave import needs_octave

import symgen
from oracles.free_flyer import free_flyer
from oracles.urdf_robots import ur5
from symgen.certify import call_octave
from symgen.certify.call_octave import Call, OctaveError, called, text_of
from symgen.certify.importing import without_certificate
from symgen.certify.modules import certified_files, certify
from symgen.derive.models import OPTIONS
from symgen.derive.regressor import inertial_names
from symgen.description import load_robot, packaged_robots, parse_robot
from symgen.description.files import on_base
from symgen.description.tree_robot import read_tree
from symgen.emit.generate import generate_files
from symgen.emit.matlab_target import KEYWORDS, LONGEST
from symgen.errors import SymgenError
from symgen.regroup.regrouping import regroup

GENERAL_LOOPS = {"four_bar", "five_bar"}
ROBOTS = [name for name in packaged_robots() if name not in GENERAL_LOOPS]
TOLERANCE = 1e-12  # of the largest entry
FORMS = """
symgen: 1
name: forms
gravity: [0, 0, -g]
constants: {g: 9.81, L: 0.4, end: 0.3, zeros: 0.2, N: 0.1, axis: 0.7, constants: 0.15, temperature: 25}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: N}
  2: {ant: 1, sigma: 0, alpha: pi/2, d: end/(L*axis), theta: q2, r: zeros**2}
  3: {ant: 2, sigma: 1, alpha: pi/3, d: L, theta: constants, r: q3}
elements:
  Ia: {kind: inertia, along: {1: q1, 2: q1 + 50*q2, 3: q3}}
  FV: {kind: viscous, along: all}
  FP: {kind: coulomb, along: all, when: positive}
  FN: {kind: coulomb, along: all, when: negative}
  VN: {kind: viscous, along: [2], when: negative}
  FT: {kind: tanh, along: [1]}
  FB: {kind: stribeck, along: [2]}
  KS: {kind: stiffness, along: {1: q1 - 2*q2}}
  OFF: {kind: offset, along: all}
columns:
  SPA: {along: 2, energy: "sqrt(1.3 - 0.8*cos(q - axis))", unit: N*m}
  SPD: {along: 1, energy: "max(q1, q2)**2 + min(q1, 0.3)", unit: N*m}
  TC: {along: 2, torque: "sign(qd)*abs(qd)**1.5*exp(-channel.temperature/20)", unit: N*m}
"""
"""Drives, friction of all kinds, springs, laws of the file, words of MATLAB as constants."""


def texts(robot, options=()):
    return generate_files(robot, targets=("matlab",), command=robot.name, options=options)


@cache
def forms():
    return parse_robot(FORMS.encode(), "forms.yaml")


def octave(files, name, *arguments, results=1):
    """Results of a function in Octave; OctaveError where it fails."""
    (found,) = called(files, [Call(name, [np.asarray(a, float) for a in arguments], results)])
    return found[0] if results == 1 else found


def assert_agrees(found, expected):
    expected = np.asarray(expected)
    assert found.reshape(expected.shape).size == expected.size
    scale = max(np.abs(expected).max(initial=0), 1e-9)
    assert np.abs(found.reshape(expected.shape) - expected).max(initial=0) < TOLERANCE * scale


def assert_agrees_with_python(robot, samples=(0, 1, 7), options=()):
    """All functions of the Python module, in one go; results keep their axes."""
    module, files = symgen.model(robot, options=options), texts(robot, options)
    n, b = len(module.JOINTS), len(module.BASE_PARAMETERS)
    rng = np.random.default_rng(3)
    chi, X = rng.normal(size=len(module.STANDARD_PARAMETERS)), rng.normal(size=b)
    own = {c: x * rng.uniform(0.95, 1.05) for c, x in module.CONSTANTS.items()}
    constants = [np.array([*own.values()])] if own else []
    base = ["base"] if robot.base_moves else []
    arguments = {
        "regressor": [*base, "q", "qd", "qdd"],
        "inverse_dynamics": [*base, "q", "qd", "qdd", "X"],
        "bias": [*base, "q", "qd", "X"],
        "gravity": [*base, "q", "X"],
        "inertia_matrix": ["q", "X"],
        "forward_dynamics": [*base, "q", "qd", "tau", "X"],
        "frame_poses": ["q"],
        "coriolis": ["q", "qd", "X"],
        "slotine_li_regressor": ["q", "qd", "qdr", "qddr"],
        "momentum_regressor": ["q", "qd"],
        "momentum_rate_regressor": ["q", "qd"],
        "energy_regressor": ["q", "qd"],
        "base_wrench_regressor": ["q", "qd", "qdd"],
    }
    tried = []
    for N in samples:
        q, qd, qdd, qdr, qddr = rng.uniform(-1.5, 1.5, (5, N, n))
        given = {"q": q, "qd": qd, "qdd": qdd, "qdr": qdr, "qddr": qddr, "tau": qdd, "X": X}
        given["base"] = rng.normal(size=(N, 9))
        calls, expected = [Call(f"{module.NAME}_base_parameters", [chi, *constants])], []
        expected.append(module.base_parameters(chi, **own)[:, None])
        for name, read in arguments.items():
            if hasattr(module, name) and f"{module.NAME}_{name}.m" in files:
                states = [given[a] for a in read]
                calls.append(Call(f"{module.NAME}_{name}", [*states, *constants]))
                expected.append(getattr(module, name)(*states, **own))
                tried.append(name)
        for frame in range(1, len(robot.frames) + 1):
            calls.append(Call(f"{module.NAME}_jacobian", [q, np.array([frame]), *constants]))
            expected.append(module.jacobian(q, frame=frame, **own))
        for call, found, right in zip(calls, called(files, calls), expected, strict=True):
            shape = [*np.shape(right)]
            while len(shape) > 2 and shape[-1] == 1:
                shape.pop()
            assert list(found[0].shape) == shape + [1] * (2 - len(shape)), call.name
            scale = max(np.abs(right).max(initial=0), 1e-9)
            if call.name.endswith("forward_dynamics"):  # as good as A is regular
                A = module.inertia_matrix(q, X, **own)
                right = found[0] if not N else right
                scale *= max(np.linalg.cond(A).max(initial=1), 1)
            wrong = np.abs(found[0].reshape(right.shape) - right).max(initial=0)
            assert wrong < TOLERANCE * scale, (call.name, wrong / scale)
    return {*tried}


@needs_octave
@pytest.mark.parametrize("name", sampled(ROBOTS, 3, always=("tx40", "sr400", "emps_asymmetric")))
@some(4)
def test_agrees_with_numpy(name):
    assert len(assert_agrees_with_python(load_robot(name))) >= 6


@needs_octave
@pytest.mark.parametrize("name", ["forms", "tx40", "scara", "haptic"])
@some(2)
def test_agrees_with_numpy_on_a_base_that_moves(name):
    robot = forms() if name == "forms" else load_robot(name)
    assert_agrees_with_python(on_base(robot, "moving"), samples=(1, 7))


@needs_octave
def test_drives_friction_springs_and_laws():
    """One value of a channel a sample, too: constants of a row for each sample."""
    robot = forms()
    assert len(assert_agrees_with_python(robot)) == 7
    module, files = symgen.model(robot), texts(robot)
    rng = np.random.default_rng(5)
    q, qd, qdd = rng.normal(size=(3, 6, 3))
    T = rng.uniform(10, 60, 6)
    rows = np.tile([*module.CONSTANTS.values()], (6, 1))
    rows[:, [*module.CONSTANTS].index("temperature")] = T
    found = octave(files, "forms_regressor", q, qd, qdd, rows)
    assert_agrees(found, module.regressor(q, qd, qdd, temperature=T))
    # defaults are those of the robot file
    assert_agrees(octave(files, "forms_regressor", q, qd, qdd), module.regressor(q, qd, qdd))


@needs_octave
def test_functions_on_request():
    found = assert_agrees_with_python(load_robot("scara"), samples=(1, 5), options=OPTIONS)
    assert {"coriolis", "momentum_rate_regressor", "energy_regressor"} <= found


@needs_octave
def test_momentum_rate_is_the_rate_of_the_momentum():
    """dp/dt - Gamma along a motion, by differences of sixth order in Octave alone."""
    files = texts(load_robot("scara"), ("momentum",))
    files |= texts(load_robot("scara"))
    rng, h, N = np.random.default_rng(0), 0.002, 5
    q, qd, qdd = rng.uniform(-1, 1, (3, N, 4))
    X = rng.uniform(1, 2, octave(files, "scara_regressor", q, qd, qdd).shape[2])

    def momentum(t):
        p = octave(files, "scara_momentum_regressor", q + t * qd + t**2 / 2 * qdd, qd + t * qdd)
        return p @ X

    weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
    rate = sum(c * (momentum(k * h) - momentum(-k * h)) / h for k, c in weights.items())
    rest = octave(files, "scara_momentum_rate_regressor", q, qd) @ X
    tau = octave(files, "scara_inverse_dynamics", q, qd, qdd, X)
    assert np.abs(rate - rest - tau).max() < 1e-10 * np.abs(tau).max()


@needs_octave
@pytest.mark.parametrize("base", ["fixed", "moving"])
def test_torques_are_those_of_pinocchio(base):
    """A free-flyer at rest is the fixed robot."""
    robot, notes = read_tree(ur5().encode(), "arm.urdf", exact=True)
    robot = on_base(robot, base)
    names = dict(re.findall(r"q(\d+) = '([^']*)'", notes[0]))
    motion = free_flyer(ur5(), [names[str(j)] for j in robot.joints], 30)
    files, inertial = texts(robot), inertial_names(robot)  # pinocchio's recursion has no friction
    chi = [robot.values.get(name, 0.0) * (name in inertial) for name in robot.parameters]
    X = octave(files, "ur5_base_parameters", chi)
    if base == "moving":
        found = octave(files, "ur5_inverse_dynamics", *motion[:4], X)
        assert_agrees(found, motion.tau)
        D = octave(files, "ur5_regressor", *motion[:4])
        W = D.reshape(-1, D.shape[2], order="F")  # reshape(D, [], b): rows joint-major
        assert_agrees(W @ X.ravel(), motion.tau.T.ravel())
    else:
        import pinocchio as pin

        model = pin.buildModelFromXML(ur5())
        data = model.createData()
        tau = [pin.rnea(model, data, *x) for x in zip(*motion[1:4], strict=True)]
        assert_agrees(octave(files, "ur5_inverse_dynamics", *motion[1:4], X), tau)


@needs_octave
@campaign
@pytest.mark.parametrize("base", ["fixed", "moving"])
@pytest.mark.parametrize("name", ROBOTS)
def test_every_packaged_robot_is_certified(name, base):
    robot = load_robot(name, base=base)
    files = certified_files(robot, targets=("matlab",))
    assert len(files) >= 10
    for text in files.values():
        assert "in Octave." in text.replace("\n% ", " ") and text.count("sha256 of all") == 1


@needs_octave
def test_wrong_texts_are_refused():
    """Of a function, of one that it calls, of the constants, the names, the base."""
    regrouping = regroup(load_robot("tx40", base="moving"))
    files = texts(regrouping.robot)
    assert certify(regrouping, files).valid
    for file, old, new in (
        ("tx40_regressor.m", "W20 = base(:, 2);", "W20 = base(:, 1);"),
        ("tx40_gravity.m", "VP30 = base(:, 9);", "VP30 = base(:, 6);"),
        ("tx40_base_parameters.m", "X(1) = XX1 ", "X(1) = -XX1 "),
        ("tx40_regressor.m", "constants = [0.225, 0.225, ", "constants = [0.225, 0.235, "),
        ("tx40_model.m", "'XX2R', 'XY2'", "'XY2', 'XX2R'"),
        ("tx40_model.m", "model.joints = [1, 2", "model.joints = [2, 1"),
        ("tx40_forward_dynamics.m", "rest = tau - ", "rest = tau + "),
        ("tx40_jacobian.m", "arm(:, 3) - axis", "arm(:, 3) + axis"),
        ("tx40_frame_poses.m", "T = zeros(N, 6, 4, 4);", "T = zeros(N, 7, 4, 4);"),
        ("tx40_bias.m", "GAM(:, 1) = ", "GAM(:, 1) = 1i*"),
        ("tx40_bias.m", "GAM = zeros", "GAM == zeros"),
    ):
        assert old in files[file], (file, old)
        changed = {**files, file: files[file].replace(old, new, 1)}
        found = certify(regrouping, changed)
        assert not found.texts[file].valid, new
        assert [f for f, check in found.texts.items() if not check.valid] != []


@needs_octave
def test_bad_arguments_are_refused_in_one_sentence():
    robot = load_robot("planar_2r", base="moving")
    files, q, base = texts(robot), np.zeros((5, 2)), np.zeros((5, 9))
    for name, arguments, said in (
        ("regressor", [base, q, q, q[:4]], "expected q, qd, qdd of N rows and 2 columns, base of N rows and 9 columns"),
        ("regressor", [base[:, :8], q, q, q], "base of N rows and 9 columns"),
        ("gravity", [base, q, np.ones(3)], "expected X of 22 base parameters"),
        ("jacobian", [q, [3]], "expected a frame from 1 to 2"),
        ("frame_poses", [q, [0.1, 0.2, 0.3]], "expected constants of 2 columns"),
        ("base_parameters", [np.ones(4)], "expected 28 standard parameters"),
    ):  # fmt: skip
        with pytest.raises(OctaveError, match=re.escape(said)):
            octave(files, f"planar_2r_{name}", *arguments)


@needs_octave
def test_a_formula_for_one_sign_is_refused_for_the_other():
    text = """
symgen: 1
name: pulley
gravity: [0, 0, -9.81]
constants: {r: 2.0}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
elements:
  FA: {kind: coulomb, along: {1: q1}}
  FB: {kind: coulomb, along: {1: r*q1}}
"""
    robot = parse_robot(text.encode(), "pulley.yaml")
    module, files = symgen.model(robot), texts(robot)
    chi = np.arange(1.0, 1 + len(robot.parameters))
    assert_agrees(
        octave(files, "pulley_base_parameters", chi, [3.0]),
        module.base_parameters(chi, r=3.0)[:, None],
    )
    with pytest.raises(ValueError, match="positive"):
        module.base_parameters(chi, r=-2.0)
    with pytest.raises(OctaveError, match="holds where r is positive, as in the robot file"):
        octave(files, "pulley_base_parameters", chi, [-2.0])


@needs_octave
def test_nan_stays_nan():
    """max(NaN, 0) is 0 in MATLAB; friction in one direction has a function of its own."""
    files = texts(load_robot("emps_asymmetric"))
    module = symgen.model("emps_asymmetric")
    q = np.zeros((3, 1))
    qd = np.array([[np.nan], [1.0], [-1.0]])
    found = octave(files, "emps_asymmetric_regressor", q, qd, q)
    with np.errstate(invalid="ignore"):
        expected = module.regressor(q, qd, q)
    np.testing.assert_allclose(found.reshape(expected.shape), expected)


@needs_octave
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT])
def test_an_octave_that_a_signal_ends_leaves_no_file(number, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    server = call_octave._Octave(call_octave.octave())
    np.zeros(1).tofile(tmp_path / call_octave.CALLS)
    server.run(tmp_path)  # no call, but a variable
    before = {*tmp_path.iterdir()}
    server.process.send_signal(number)
    server.process.stdin.close()
    server.process.wait()
    server.close()
    assert {*tmp_path.iterdir()} == before


@needs_octave
def test_names_and_values():
    module, files = symgen.model("tx40"), texts(load_robot("tx40"))
    (values,) = called(files, [Call("tx40_model", [])])
    found = dict(zip(map(text_of, values[::2]), values[1::2], strict=True))
    assert text_of(found["base_parameters"]).split() == [*module.BASE_PARAMETERS]
    assert text_of(found["constants"]).split() == [*module.CONSTANTS]
    np.testing.assert_allclose(found["X"].ravel(), module.BASE_VALUES, rtol=1e-15)
    X = octave(files, "tx40_base_parameters", found["standard_values"])
    np.testing.assert_allclose(X.ravel(), module.BASE_VALUES, rtol=1e-12, atol=1e-15)


def test_the_language_that_matlab_and_octave_share():
    """No word, operator or comment of Octave alone; lines of 100 columns; short names."""
    for robot in (load_robot("tx40"), load_robot("haptic"), forms(), load_robot("emps_asymmetric")):
        files = texts(robot)
        assert texts(robot) == files
        for file, text in files.items():
            lines = text.splitlines()
            assert lines[0].startswith("function ") and f" {file[:-2]}" in lines[0]
            assert lines[1].startswith(f"% {file[:-2].upper()}  ")
            assert sum("SPDX-License-Identifier: BSD-3-Clause" in line for line in lines) == 1
            assert max(map(len, lines)) <= 100
            code = [re.sub(r"'[^']*'|% .*", "", x) for x in lines if not x.startswith("%")]
            assert not [x for x in code if re.search(r"[!#\"]|\+\+|--|[-+*/]=|\bend[a-z]+", x)]
            words = {w for x in code for w in re.findall(r"[A-Za-z]\w*", x)}
            assert max(map(len, words)) <= LONGEST
            assigned = {m[1] for x in code if (m := re.match(r" *(\w+) = ", x))}
            assert not assigned & {*KEYWORDS.split()}
            opened = sum(bool(re.match(r" *(function|if|for|while)\b", x)) for x in code)
            assert opened == sum(x.strip() == "end" for x in code)


def test_constants_with_the_words_of_matlab_are_told():
    text = texts(forms())["forms_regressor.m"]
    assert "end_ = constants(:, 3);" in text and "zeros_ = constants(:, 4);" in text
    header = texts(forms())["forms_model.m"]
    assert "end_ stands for end, which is another name of this text" in header


def test_what_cannot_be_written_is_told():
    assert texts(load_robot("four_bar")) == {}
    long = replace(load_robot("planar_2r"), name="a" * 40)
    assert len(texts(long)) == 10
    with pytest.raises(
        SymgenError, match=r"MATLAB cuts names off after 63 characters, and a{40}_mom"
    ):
        texts(long, ("momentum",))


@needs_octave
@pytest.mark.parametrize("title", ["%{ ' \" x", "%} end", "... %", "100 % of 'it'", "ä ü"])
@some(2)
def test_texts_stay_in_their_comments(title):
    robot = replace(load_robot("planar_2r"), title=title)
    plain = {
        file: [x for x in text.splitlines() if not x.startswith("%")]
        for file, text in texts(load_robot("planar_2r")).items()
    }
    found = certified_files(robot, targets=("matlab",), command=title)
    for file, text in found.items():
        assert [
            x for x in without_certificate(text).splitlines() if not x.startswith("%")
        ] == plain[file]
