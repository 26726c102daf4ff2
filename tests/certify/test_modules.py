"""The certificate evaluates the emitted module, and `symgen.model` imports it from a cache that
nothing can spoil.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from campaign import some
from hang import HANG
from typer.testing import CliRunner

import symgen
from oracles.random_robots import random_robot
from runtime import load_model
from runtime.core import loading
from symgen.certify import importing, requests
from symgen.certify.importing import without_certificate
from symgen.certify.lagrange import Lagrange
from symgen.certify.modules import certified_files, certify, require_valid
from symgen.certify.requests import model
from symgen.certify.texts import DERIVATIVES, TextCheck
from symgen.cli.main import app
from symgen.derive.loops import close
from symgen.description import load_robot, packaged_robots
from symgen.description.angles import AngleWarning
from symgen.emit.generate import generate_files, generate_module
from symgen.errors import CertificateError, SymgenError
from symgen.regroup.regrouping import regroup

ROBOT = """
symgen: 1
name: arm
gravity: [0, 0, -g]
constants: {g: 9.81, D2: 0.4}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: pi/6, d: D2, theta: q2, r: sqrt(3)/2}
elements:
  FV: {kind: viscous, along: all}
"""
FUNCTIONS = ("regressor", "inverse_dynamics", "inertia_matrix", "gravity")
ALL = {
    *FUNCTIONS, "bias", "elements", "base_parameters", "observation_matrix", "forward_dynamics", "frame_poses",
    "jacobian",
}  # fmt: skip


def errors(certificate):
    """{function: error} of the module."""
    (text,) = certificate.texts.values()
    return text.errors


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def wrong(text: str, function: str) -> str:
    """The text with 0.001 added to one entry of a function."""
    head, mark, block = text.partition(f"def _{function}_block(")
    entry = {"regressor": "D", "inertia_matrix": "A"}.get(function, "GAM")
    changed, count = re.subn(
        rf"^( +{entry}\[[^=]*\] = )(?=[^=]*$)",
        r"\g<1>1e-3 + ",
        block,
        count=1,
        flags=re.MULTILINE,
    )
    assert mark and count == 1
    return head + mark + changed


@pytest.mark.parametrize("name", packaged_robots())
@some(4)
def test_modules_of_packaged_robots_are_evaluated(name: str) -> None:
    certificate = certify(regroup(load_robot(name)))
    assert certificate.valid, str(certificate)
    robot = load_robot(name)
    more = {"passive_joints"} if robot.passive else set()
    more |= {DERIVATIVES} if not close(robot).tied else set()
    assert set(errors(certificate)) == ALL | more
    assert max(errors(certificate).values()) < 1e-11


def test_gravity_is_left_out_where_friction_takes_in_a_weight() -> None:
    """One-sided Coulomb friction without an offset: the module says in its header that torques at
    rest are not those of the mechanism.
    """
    certificate = certify(regroup(random_robot(116)))
    assert certificate.valid and set(errors(certificate)) == (ALL | {DERIVATIVES}) - {"gravity"}


@pytest.mark.parametrize("function", FUNCTIONS)
def test_one_wrong_entry_of_a_module_is_caught(function: str) -> None:
    """The formulas are right, the text is not: before, nothing read the text."""
    base = regroup(load_robot("scara"))
    text = generate_module(base.robot)
    assert certify(base, {"scara.py": text}).valid
    certificate = certify(base, {"scara.py": wrong(text, function)})
    assert not certificate.valid and not certificate.failures and certificate.numeric_valid
    users = {
        "regressor": {"observation_matrix"},
        "inverse_dynamics": {"bias", "forward_dynamics"},
        "inertia_matrix": {"forward_dynamics"},
    }
    seen = {name for name, error in errors(certificate).items() if error > 1e-6}
    assert seen == {function} | users.get(function, set())
    assert f"FALSE {function} of scara.py" in str(certificate)
    assert json.loads(json.dumps(certificate.mapping()))["valid"] is False


def test_nothing_is_generated_where_the_module_is_wrong(monkeypatch, cache) -> None:
    import symgen.certify.modules as certified

    def spoiled(robot, **options):
        return {
            name: wrong(text, "regressor")
            for name, text in generate_files(robot, **options).items()
        }

    monkeypatch.setattr(certified, "generate_files", spoiled)
    for act in (certified_files, model):
        with pytest.raises(
            CertificateError,
            match=(
                r"^scara: a check of the generated module failed \(regressor of scara.py .*\), so "
                r"nothing is written"
            ),
        ) as error:
            act(load_robot("scara"))
        assert not error.value.certificate.valid
    result = CliRunner().invoke(app, ["generate", "scara", "-o", str(cache)])
    assert (
        result.exit_code == 1
        and "regressor of scara.py" in result.stderr
        and "Traceback" not in result.output
    )
    assert not cache.exists()


@pytest.mark.parametrize("given", ["name", "text", "path", "robot"])
def test_a_robot_becomes_a_module(tmp_path, cache, given) -> None:
    path = tmp_path / "arm.YAML"
    path.write_text(ROBOT)
    source = {"name": "planar_2r", "text": str(path), "path": path, "robot": load_robot(path)}[
        given
    ]
    module = symgen.model(source)
    described = load_robot("planar_2r" if given == "name" else path)
    text = Path(module.__file__).read_text()
    assert without_certificate(text) == generate_module(described) != text
    digest = sha256(without_certificate(text).encode()).hexdigest()
    assert "\n\nCertificate by symgen " in text
    assert f'\nsha256 of all but these lines: {digest}\n"""\n' in text
    assert Path(module.__file__).is_relative_to(cache)
    assert load_model(module) is module
    q, qd, qdd = np.random.default_rng(0).uniform(-1, 1, (3, 20, 2))
    chi = np.random.default_rng(1).standard_normal(len(described.parameters))
    tau = Lagrange(described).torque(q, qd, qdd, chi)
    assert (
        np.abs(module.regressor(q, qd, qdd) @ module.base_parameters(chi) - tau).max()
        < 1e-12 * np.abs(tau).max()
    )


def test_a_name_that_is_no_robot(cache) -> None:
    with pytest.raises(SymgenError, match="no packaged robot"):
        symgen.model("planar_3r")


def test_a_second_call_takes_what_lies_in_the_cache(cache, monkeypatch) -> None:
    import symgen.certify.modules as certified

    first = symgen.model("planar_2r")
    monkeypatch.setattr(
        certified, "certify", None
    )  # not called again: what lies there has been certified
    assert symgen.model("planar_2r").__file__ == first.__file__
    assert sum(1 for path in cache.rglob("*") if path.is_file()) == 1


@pytest.fixture
def derivations(monkeypatch) -> list[str]:
    """Names of the robots whose text is emitted, one entry for each emission."""
    import symgen.certify.modules as certified

    names: list[str] = []

    def counted(robot, **options):
        names.append(robot.name)
        return generate_files(robot, **options)

    monkeypatch.setattr(certified, "generate_files", counted)
    return names


@pytest.mark.parametrize("make", [symgen.model, symgen.variants])
def test_a_second_call_derives_nothing(cache, derivations, make) -> None:
    first = make("planar_2r")
    assert derivations == ["planar_2r"]
    assert make(load_robot("planar_2r")).__file__ == first.__file__
    assert derivations == ["planar_2r"]


MJCF = """<mujoco model="arm"><compiler angle="radian"/><include file="more.xml"/></mujoco>"""
BODY = """<mujoco><worldbody><body name="upper"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<joint name="a" axis="0 0 1"/><body name="fore" pos="{} 0 0">
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="b" axis="0 0 1"/></body></body>
</worldbody></mujoco>"""


def test_a_changed_file_a_changed_include_and_other_options_are_derived(
    tmp_path, cache, derivations
) -> None:
    yaml, xml, more = (tmp_path / name for name in ("arm.yaml", "arm.xml", "more.xml"))
    yaml.write_text(ROBOT)
    xml.write_text(MJCF)
    more.write_text(BODY.format(0.3))
    steps = [
        lambda: symgen.model(yaml),
        lambda: symgen.model(yaml, options=("coriolis",)),
        lambda: symgen.model(replace(load_robot(yaml), assume=frozenset({"XY1"}))),
        lambda: yaml.write_text(ROBOT.replace("D2: 0.4", "D2: 0.5")) and symgen.model(yaml),
        lambda: symgen.model(xml),
        lambda: more.write_text(BODY.format(0.4)) and symgen.model(xml),
    ]
    texts = [Path(step().__file__).read_text() for step in steps]
    assert len(derivations) == len(steps)
    assert len(set(texts)) == len(steps)


def test_angles_read_exactly_and_rounded_are_two_models(tmp_path, cache) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(
        '<robot name="arm"><link name="l0"/><link name="l1"/><link name="l2"/>'
        '<joint name="a" type="continuous"><parent link="l0"/><child link="l1"/></joint>'
        '<joint name="b" type="continuous"><parent link="l1"/><child link="l2"/>'
        '<origin rpy="1.57080 0 0" xyz="0.3 0 0"/></joint></robot>'
    )
    with pytest.warns(AngleWarning):
        rounded = symgen.model(path)
    exact = symgen.model(load_robot(path, exact=True))
    assert exact.__file__ != rounded.__file__
    with pytest.warns(AngleWarning):  # from the cache too
        assert symgen.model(path).__file__ == rounded.__file__


@pytest.mark.parametrize(
    ("name", "value"), [("VERSION", "0.0.1"), ("_sources", lambda: "newer files")]
)
def test_another_version_derives_again(cache, derivations, monkeypatch, name, value) -> None:
    symgen.model("planar_2r")
    monkeypatch.setattr(requests, name, value)
    symgen.model("planar_2r")
    assert derivations == ["planar_2r"] * 2


@pytest.mark.parametrize("spoiled", [b"", b"raise SystemExit\n", b"\xff\x00"])
def test_a_spoiled_entry_is_written_again(cache, spoiled) -> None:
    path = Path(symgen.model("planar_2r").__file__)
    text = path.read_bytes()
    path.write_bytes(spoiled)
    module = symgen.model("planar_2r")
    assert (
        Path(module.__file__) == path and path.read_bytes() == text and module.NAME == "planar_2r"
    )


def test_bytecode_beside_an_entry_is_not_run(cache) -> None:
    path = Path(symgen.model("planar_2r").__file__)
    beside = path.parent / "__pycache__" / f"{path.stem}.{sys.implementation.cache_tag}.pyc"
    beside.parent.mkdir()
    beside.write_bytes(b"\x00" * 100)
    assert symgen.model("planar_2r").NAME == "planar_2r" and beside.read_bytes() == b"\x00" * 100


def test_where_the_cache_cannot_be_written_a_temporary_file_serves(tmp_path, monkeypatch) -> None:
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "file"))
    module = symgen.model("planar_2r")
    assert (
        module.NAME == "planar_2r"
        and Path(module.__file__).is_file()
        and not Path(module.__file__).is_relative_to(tmp_path)
    )


def test_a_cache_for_reading_alone_is_read(cache, monkeypatch) -> None:
    first = Path(symgen.model("planar_2r").__file__)

    def refused(path: Path, text: str) -> Path:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(importing, "_write", refused)
    assert Path(symgen.model("planar_2r").__file__) == first
    with pytest.raises(SymgenError, match="Permission denied; set SYMGEN_CACHE or TMPDIR"):
        symgen.model("emps")


@pytest.mark.skipif(os.name != "posix", reason="permission bits")
@pytest.mark.parametrize(("place", "mode"), [("modules", 0o777), ("", 0o777), ("", 0o1777)])
def test_a_cache_that_others_may_write_to_is_refused(cache, place, mode) -> None:
    """Itself, or a folder above it, in which another could take its place."""
    (cache / "modules").mkdir(parents=True)
    (cache / place).chmod(mode)
    if mode == 0o1777:  # as /tmp: names belong to their makers
        assert Path(symgen.model("planar_2r").__file__).is_relative_to(cache)
        return
    with pytest.raises(SymgenError, match=r"SYMGEN_CACHE: other users can write to .*chmod 700"):
        symgen.model("planar_2r")


@pytest.mark.skipif(os.name != "posix", reason="permission bits")
@pytest.mark.parametrize("way", ["link", "link to a part", ".."])
def test_a_cache_is_judged_where_it_is(way, tmp_path, monkeypatch) -> None:
    """Another could replace the folder at the end of a link, or that which `..` leads to."""
    shared, own = tmp_path / "shared", tmp_path / "own"
    (shared / "part").mkdir(parents=True)
    own.mkdir()
    shared.chmod(0o777)
    (own / "link").symlink_to(shared / "part")
    given = {
        "link": own / "link",
        "link to a part": own / "link" / "cache",
        "..": own / "link" / "..",
    }
    monkeypatch.setenv("SYMGEN_CACHE", str(given[way]))
    with pytest.raises(SymgenError, match="SYMGEN_CACHE: other users can write to"):
        symgen.model("planar_2r")


@pytest.mark.skipif(os.name != "posix", reason="permission bits")
def test_a_link_from_a_shared_folder_is_followed(tmp_path, monkeypatch) -> None:
    """The folder itself is used, by its own path."""
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared" / "link").symlink_to(tmp_path / "cache")
    (tmp_path / "shared").chmod(0o777)
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "shared" / "link"))
    assert Path(symgen.model("planar_2r").__file__).is_relative_to(tmp_path / "cache")


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="no XDG folders")
@pytest.mark.parametrize(
    "folder", [importing.cache_folder, lambda: loading.cache_folder("modules")]
)
def test_a_relative_xdg_cache_home_is_ignored(folder, tmp_path, monkeypatch) -> None:
    monkeypatch.delenv("SYMGEN_CACHE", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    for given in ("", ".", "cache", "../cache"):
        monkeypatch.setenv("XDG_CACHE_HOME", given)
        assert folder() == tmp_path / ".cache" / "symgen" / "modules"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert folder() == tmp_path / "xdg" / "symgen" / "modules"


def test_foreign_text_in_the_certificate_of_an_entry_is_not_run(cache, tmp_path) -> None:
    path, mark = Path(symgen.model("planar_2r").__file__), tmp_path / "mark"
    text = path.read_bytes()
    foreign = (
        f"# Certificate by symgen coding: raw_unicode_escape \\u000aopen({str(mark)!r},'w')#\n"
    )
    foreign += f"# {importing.END}{64 * '0'}\n{without_certificate(text.decode())}"
    path.write_text(foreign, encoding="utf-8")
    assert symgen.model("planar_2r").NAME == "planar_2r"
    assert path.read_bytes() == text and not mark.exists()


def test_two_processes_at_once_and_others_that_load_the_file(cache) -> None:
    code = "import symgen; m = symgen.model('planar_2r'); print(m.__file__, m.NAME)"
    environment = {**os.environ, "SYMGEN_CACHE": str(cache)}
    started = [
        subprocess.Popen(
            [sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    files = {process.communicate(timeout=HANG)[0] for process in started}
    assert [process.returncode for process in started] == [0, 0] and len(files) == 1
    file, name = files.pop().split()
    assert load_model(Path(file)).NAME == name == "planar_2r"
    assert [path for path in cache.rglob("*") if path.is_file()] == [
        Path(file)
    ]  # nothing half written is left


@pytest.mark.parametrize("change", [{"numeric_rank": 3}, {"torque_error": 1e-6}, {"torque_error": float("nan")}, {"failures": ("column of M1",)},
                                    {"texts": {"planar_2r.py": TextCheck("numpy", "", {"bias": float("nan")})}}])  # fmt: skip
def test_every_check_counts_for_the_verdict(change) -> None:
    """`certify().valid` was true where `symgen check` printed FALSE: the numeric checks were those
    of the command line alone.
    """
    certificate = certify(regroup(load_robot("planar_2r")))
    worse = replace(certificate, **change)
    assert (
        certificate.valid
        and certificate.mapping()["valid"]
        and str(certificate).endswith("certificate valid")
    )
    assert (
        not worse.valid
        and not worse.mapping()["valid"]
        and str(worse).endswith("certificate FALSE")
    )
    with pytest.raises(CertificateError):
        require_valid(worse)


@pytest.mark.parametrize(("name", "valid"), [("planar_2r", True), ("scara", False)])
def test_the_verdict_is_that_of_symgen_check(name, valid, monkeypatch) -> None:
    from symgen.regroup import regrouping as module

    base = regroup(load_robot(name))
    base = base if valid else replace(base, base=base.base[:-1])
    monkeypatch.setattr(module, "regroup", lambda robot: base)
    result = CliRunner().invoke(app, ["check", name, "--json"])
    assert json.loads(result.stdout)["valid"] is certify(
        base
    ).valid is valid and result.exit_code == (0 if valid else 1)
