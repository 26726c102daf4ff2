"""A module is code: it runs where this installation has emitted and certified it, or where its
reader trusts it. What is loaded is then checked.
"""

import pickle
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from campaign import some
from typer.testing import CliRunner

import symgen
from runtime import load_model
from runtime.ground.errors import InputError, ModelError
from symgen.cli.main import app

EMITTED = Path(__file__).parents[2] / "generated"


@pytest.fixture
def generated(tmp_path, monkeypatch):
    """planar_2r as `symgen generate` writes it, with a cache of its own."""
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "cache"))
    targets = ["--target", "numpy,c"]
    done = CliRunner().invoke(app, ["generate", "planar_2r", *targets, "-o", str(tmp_path)])
    assert done.exit_code == 0, done.output
    return tmp_path


def appended(path, line):
    path.write_text(path.read_text(encoding="utf-8") + line + "\n", encoding="utf-8")


def test_what_was_emitted_here_runs(generated):
    """Under any name, from any folder: the text counts."""
    assert load_model("planar_2r", folder=generated).NAME == "planar_2r"
    moved = (generated / "planar_2r.py").rename(generated / "arm.py")
    assert load_model(moved).NAME == "planar_2r"


def test_one_more_line_is_refused_without_trust(generated):
    """It does not run."""
    mark = generated / "mark"
    file = generated / "planar_2r.py"
    appended(file, f"__import__('pathlib').Path({str(mark)!r}).touch()")
    with pytest.raises(ModelError, match="has not generated and certified; pass trust=True"):
        load_model(file)
    assert not mark.exists()
    assert load_model(file, trust=True).NAME == "planar_2r" and mark.exists()


def test_a_cache_that_anyone_may_write_to_proves_nothing(generated):
    (generated / "cache" / "modules").chmod(0o777)
    with pytest.raises(ModelError, match="pass trust=True"):
        load_model("planar_2r", folder=generated)


def test_a_cache_behind_a_link_is_judged_where_it_is(generated):
    shared = generated / "shared"
    shared.mkdir()
    (generated / "cache").rename(shared / "cache")
    (generated / "cache").symlink_to(shared / "cache")
    assert load_model("planar_2r", folder=generated).NAME == "planar_2r"
    shared.chmod(0o777)
    with pytest.raises(ModelError, match="pass trust=True"):
        load_model("planar_2r", folder=generated)


def test_a_module_of_python_needs_no_file():
    module = symgen.model("planar_2r")
    assert load_model(module) is module


@pytest.mark.parametrize("verb", ["identify", "cestac", "compare", "report", "simulate", "excite"])
@some(2)
def test_verbs_ask_for_trust(verb, generated):
    """In one sentence; --trust lets the module run, and the record is looked at next."""
    appended(generated / "planar_2r.py", "MORE = 1")
    arguments = [verb, str(generated / "planar_2r.py"), str(generated / "study.yaml")]
    refused = CliRunner().invoke(app, arguments)
    assert refused.exit_code == 2 and "pass trust=True (--trust)" in refused.stderr
    trusted = CliRunner().invoke(app, [*arguments, "--trust"])
    assert trusted.exit_code == 2 and "study.yaml" in trusted.stderr


def test_a_model_with_texts_that_are_no_names(tmp_path):
    text = (EMITTED / "planar_2r.py").read_text(encoding="utf-8")
    for old, new, said in (
        ("NAME = 'planar_2r'", "NAME = '../../planar'", "NAME"),
        ("NAME = 'planar_2r'", "NAME = 3", "NAME"),
        ("JOINTS = (1, 2)", "JOINTS = ('1', '<b>')", "JOINTS"),
    ):
        assert old in text
        (tmp_path / "a.py").write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(ModelError, match=said):
            load_model(tmp_path / "a.py", trust=True)


def test_what_is_loaded_computes(tmp_path):
    """A copy of an emitted file under another name gives the same numbers, and numpy is what it
    was.
    """
    before = (np.sin, np.zeros, np.linalg.solve)
    (tmp_path / "b.py").write_bytes((EMITTED / "planar_2r.py").read_bytes())
    one, two = load_model(tmp_path / "b.py", trust=True), load_model("planar_2r", folder=EMITTED)
    q = np.linspace(0, 1, 6).reshape(3, 2)
    assert np.array_equal(one.observation_matrix(q, q, q), two.observation_matrix(q, q, q))
    assert before == (np.sin, np.zeros, np.linalg.solve)


@pytest.mark.parametrize("trust", [True, False])
def test_workers_run_the_text_that_was_loaded(generated, trust):
    """A file that changes on disk after it was loaded is not what travels."""
    file = generated / "planar_2r.py"
    if trust:
        appended(file, "MORE = 1")
    model = load_model(file, trust=trust)
    mark = generated / "mark"
    appended(file, f"__import__('pathlib').Path({str(mark)!r}).touch()")
    again = pickle.loads(pickle.dumps(model))  # noqa: S301
    assert again.NAME == "planar_2r" and hasattr(again, "MORE") == trust and not mark.exists()


def test_workers_run_the_text_that_the_cache_held(generated):
    model = symgen.model("planar_2r")
    file = Path(model.__file__)
    held = file.read_text(encoding="utf-8")
    try:
        appended(file, "raise SystemError")
        assert pickle.loads(pickle.dumps(model)).NAME == "planar_2r"  # noqa: S301
    finally:
        file.write_text(held, encoding="utf-8")


def test_an_imported_module_travels_as_it_was_loaded_or_not_at_all(generated, monkeypatch):
    """`from generated import planar_2r`: Python itself has read the file, which may change."""
    monkeypatch.syspath_prepend(generated)
    monkeypatch.delitem(sys.modules, "planar_2r", raising=False)
    model = import_module("planar_2r")
    monkeypatch.delitem(sys.modules, "planar_2r")
    assert pickle.loads(pickle.dumps(model)).NAME == "planar_2r"  # noqa: S301
    file = generated / "planar_2r.py"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("sha256 of all", "sha256 of"), encoding="utf-8")
    with pytest.raises(InputError, match="has changed since it was imported"):
        pickle.dumps(model)
    file.unlink()
    with pytest.raises(InputError, match="has changed since it was imported"):
        pickle.dumps(model)
