"""Results as other programs read them: JSON by its published schema, NPZ, MAT, CSV, LaTeX; hostile
names in each.
"""

import csv
import io
import json
import shutil
import subprocess
from dataclasses import replace
from functools import partial

import jsonschema
import matplotlib.mathtext
import numpy as np
import planar_2r_model as planar
import pytest
import scipy.io
from hang import HANG
from planar_data import OLS, WLS, observation, one_joint_at_rest

from runtime import InputError
from runtime.compose import estimate_of, json_schema
from runtime.core.cestac.result import Cestac, cestac_arrays, cestac_csv, level_result
from runtime.core.cestac.runs import Level, Run, Runs
from runtime.core.least_squares.estimate import Estimate
from runtime.documents.estimates import load_estimate
from runtime.ground.table import escaped, name_cell, number_cell, unit_cell
from runtime.reporting.arrays import (
    array_files,
    estimate_arrays,
    mat,
    matlab_names,
    npz,
)

HOSTILE = (
    "\\input{/etc/passwd}",
    "a%b",
    "$x$ & ^^M # ~ _",
    "\\end{tabular}\\write18{ls}",
    "é Δ 中\n\x00\u202e",
    "{",
    'end"<b>|',
)
NUMBERS = ("X", "sigma", "covariance", "sigma_corrected", "relative_sigma")


@pytest.fixture(scope="module")
def found():
    return estimate_of(
        observation(noise=(0.3, 0.05), seed=1), OLS, model=planar, provenance={"seed": 1}
    )


@pytest.fixture(scope="module")
def study(found):
    """Two steps of a resolution study with made-up runs about the reference."""
    rng, b, measured = (
        np.random.default_rng(2),
        len(found.names),
        observation(noise=(0.3, 0.05), seed=1),
    )
    results = []
    for k, level in enumerate((Level(2 * np.pi / 5000), Level(1.5e-5, 0.01))):
        runs = [
            Run(k, i, tuple(found.X * (1 + 0.01 * rng.standard_normal(b))), 3.0) for i in range(4)
        ]
        results.append(level_result(level, Runs.of(runs, b), measured, found))
    return Cestac(found.names, found, tuple(results), {"cestac": {"runs": 4}}, {"seed": 1})


def hostile(fit: Estimate) -> Estimate:
    """The same numbers under names, units and texts that try to get out."""
    names = (*HOSTILE, *fit.names[len(HOSTILE) :])
    return replace(
        fit,
        names=names,
        units=dict.fromkeys(names, HOSTILE[0]),
        message=HOSTILE[3],
        provenance={"record": HOSTILE[2]},
    )


def test_schemas_hold_for_what_is_written(found, study):
    lost = estimate_of(observation(motion=one_joint_at_rest, noise=(0.1, 0.1)), WLS, model=planar)
    for kind, results in (("estimate", (found, lost, hostile(found))), ("cestac", (study,))):
        schema = json_schema(kind)
        jsonschema.Draft202012Validator.check_schema(schema)
        for result in results:
            data = json.loads(result.to_json())
            jsonschema.validate(data, schema)
            assert set(data) <= set(schema["properties"])
            with pytest.raises(jsonschema.ValidationError):
                jsonschema.validate(data | {"schema": 1}, schema)
            with pytest.raises(jsonschema.ValidationError):
                jsonschema.validate({k: v for k, v in data.items() if k != "names"}, schema)


def test_an_estimate_comes_back_to_the_bit(found, tmp_path):
    for fit in (
        found,
        hostile(found),
        replace(found, X=np.nextafter(found.X, 9), sigma_rho=0.1 + 0.2, iterations=3),
    ):
        path = tmp_path / "estimate.json"
        path.write_text(fit.to_json(), encoding="utf-8")
        back = load_estimate(path)
        assert all(
            getattr(back, name).tobytes() == getattr(fit, name).tobytes() for name in NUMBERS
        )
        assert (back.names, back.per_joint, back.sigma_rho, back.message) == (
            fit.names,
            fit.per_joint,
            fit.sigma_rho,
            fit.message,
        )
        assert back.to_json() == fit.to_json()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: {"schema": "symgen-estimate/2"}, "reads 'symgen-estimate/1'"),
        (lambda d: {"schema": "symgen-cestac/1"}, "expected 'symgen-estimate/1'"),
        (lambda d: {"schema": 1}, "expected 'symgen-estimate/1'"),
        (lambda d: {"X": d["X"][:-1]}, "X has shape"),
        (lambda d: {"X": ["a"] * 10}, "X[0]: 'a'; expected a number"),
        (lambda d: {"names": [1] * 10}, "expected a text"),
        (lambda d: {"per_joint": [{"joint": "1"}]}, "per_joint[0]: no key rows"),
        (lambda d: {"settings": []}, "expected a mapping"),
        (lambda d: {"status": "of-another-time"}, "or another version of symgen wrote it"),
    ],
)
def test_another_file_is_refused_in_one_line(found, tmp_path, change, words):
    data = json.loads(found.to_json())
    path = tmp_path / "estimate.json"
    path.write_text(json.dumps(data | change(data)))
    with pytest.raises(InputError, match=r"estimate\.json") as refused:
        load_estimate(path)
    assert words in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "NaN",
        '{"schema": "symgen-estimate/1", "X": NaN}',
        "[" * 100_000,
        '{"schema": "symgen-estimate/1"}',
    ],
)
def test_damage_is_an_input_error(text):
    with pytest.raises(InputError):
        Estimate.from_json(text)


def test_no_file_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load_estimate(tmp_path / "none.json")
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="cannot be read"):
        load_estimate(tmp_path / "binary.json")


def test_npz_needs_no_pickle(found, study):
    for arrays in (estimate_arrays(found), estimate_arrays(hostile(found)), cestac_arrays(study)):
        with np.load(io.BytesIO(npz(arrays)), allow_pickle=False) as archive:
            assert set(archive.files) == set(arrays)
            for name in archive.files:
                assert np.array_equal(
                    archive[name], arrays[name], equal_nan=archive[name].dtype.kind == "f"
                ), name
    assert estimate_arrays(found)["names"].dtype.kind == "U"
    assert cestac_arrays(study)["e"].shape == (2, len(found.names))
    with pytest.raises(TypeError, match="objects"):
        npz({"x": np.array([None])})


def test_mat_is_what_matlab_expects(found, study):
    read = partial(scipy.io.loadmat, squeeze_me=True)
    there = read(io.BytesIO(mat(estimate_arrays(found))))
    assert list(there["names"]) == list(found.names) and there["X"].tobytes() == found.X.tobytes()
    assert float(there["value"]["FV1"]) == found["FV1"] and str(there["method"]) == "ols"
    assert scipy.io.loadmat(io.BytesIO(mat(estimate_arrays(found))))["X"].shape == (10, 1)
    levels = read(io.BytesIO(mat(cestac_arrays(study))))
    assert levels["mean"].shape == (2, 10) and list(levels["labels"]) == [
        "2*pi/5000",
        "1.5e-05 + Phi 0.01",
    ]
    odd = read(io.BytesIO(mat(estimate_arrays(hostile(found)))))
    assert all(name.isidentifier() and name.isascii() for name in odd["value"].dtype.names)


def test_names_that_matlab_allows():
    assert matlab_names(["ZZ1R", "end", "1a", "a b", "a_b", "x" * 80, "x" * 81]) == (
        "ZZ1R", "xend", "x1a", "a_b", "a_b_2", "x" * 63, "x" * 61 + "_2",
    )  # fmt: skip


def test_same_result_same_bytes(found, study):
    first, again = (
        array_files("estimate", estimate_arrays(found))
        | array_files("cestac", cestac_arrays(study))
        for _ in range(2)
    )
    assert first == again and set(first) == {
        "estimate.npz",
        "estimate.mat",
        "cestac.npz",
        "cestac.mat",
    }


def test_cestac_csv_has_one_line_per_level_and_parameter(study):
    rows = list(csv.DictReader(io.StringIO(cestac_csv(study))))
    assert len(rows) == 2 * (len(study.names) + 1)
    assert [float(r["e"]) for r in rows[:10]] == list(study.levels[0].e)
    assert rows[10]["name"] == "rho" and float(rows[10]["increase"]) == study.levels[0].increase


def test_table_2_of_the_chapter(found):
    """Name (unit), value, %sigma."""
    text = found.to_latex(["ZZ1R", "FV1"])
    assert text.startswith(
        "\\begin{tabular}{lrr}\n\\toprule\nMechanical parameters & Value & Relative deviation "
        "\\%$\\sigma$ \\\\\n\\midrule\n"
    )
    assert (
        r"$\mathrm{ZZ}_{\mathrm{1R}}$ ($\mathrm{kg\,m^{2}}$) & $" in text
        and text.count(r"\\") == 3
        and "FS1" not in text
    )
    two = found.to_latex(blocks=2)
    assert two.startswith(r"\begin{tabular}{lrrlrr}") and two.count(r"\\") == 1 + 5
    odd = found.to_latex(found.names[:5], blocks=2)
    assert odd.count(r"\\") == 1 + 3 and " &  &  & " not in odd.splitlines()[3]


def test_cells_of_tables():
    assert (
        number_cell(1.5e-7) == r"$1.5 \cdot 10^{-7}$"
        and number_cell(float("nan")) == "--"
        and number_cell(-0.5) == "$-0.5$"
    )
    assert (
        unit_cell("N*m*s/rad") == r" ($\mathrm{N\,m\,s/rad}$)"
        and unit_cell("") == ""
        and unit_cell("m^2") == r" (m\textasciicircum{}2)"
    )
    assert (
        name_cell("OFFSET6") == r"$\mathrm{OFFSET}_{\mathrm{6}}$"
        and name_cell("C2_3") == r"$\mathrm{C}_{\mathrm{2\_3}}$"
    )


COMMANDS = {"begin{tabular}", "end{tabular}", "toprule", "midrule", "bottomrule", "mathrm", "cdot", "pi", "Delta", "Phi", "rho", "sigma",
            "textbackslash", "textasciicircum", "textasciitilde", "textless", "textgreater", "textbar"}  # fmt: skip


def tokens(text):
    """Commands and special characters of a LaTeX text, by its own rules: a backslash and letters,
    or a backslash and one other character.
    """
    i, found = 0, []
    while i < len(text):
        if text[i] != "\\":
            found.append(text[i])
            i += 1
            continue
        j = i + 1
        while j < len(text) and text[j].isascii() and text[j].isalpha():
            j += 1
        j = max(j, i + 2)
        word = text[i + 1 : j]
        if word in ("begin", "end"):
            j = text.index("}", j) + 1
            word = text[i + 1 : j]
        found.append("\\" + word)
        i = j
    return found


@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_is_read_as_latex(text):
    parsed = tokens(escaped(text))
    assert {t[1:] for t in parsed if t[0] == "\\" and len(t) > 2} <= COMMANDS - {
        "begin{tabular}",
        "end{tabular}",
    }
    assert not {"%", "$", "&", "#", "^", "_", "~", "\n", "\x00", "\u202e"} & set(parsed)
    assert parsed.count("{") == parsed.count("}")


def test_hostile_tables_hold_known_commands_alone(found):
    text = hostile(found).to_latex()
    parsed = tokens(text)
    words = {t[1:] for t in parsed if t[0] == "\\" and t[1:2].isalpha()}
    assert words <= COMMANDS
    assert parsed.count("{") == parsed.count("}") and parsed.count("$") % 2 == 0
    assert "%" not in parsed and "#" not in parsed and "\x00" not in text


def test_mathematics_is_readable_by_another_parser(found):
    parse = matplotlib.mathtext.MathTextParser("path").parse
    for formula in found.to_latex().split("$")[1::2]:
        assert parse(f"${formula}$").width > 0


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no pdflatex here")
def test_latex_sets_the_tables(found, tmp_path):
    """ASCII ones: what a font has of other letters is its affair."""
    fit = hostile(found)
    fit = replace(fit, names=tuple(n.encode("ascii", "ignore").decode() for n in fit.names))
    tables = "\n\n".join(
        [
            found.to_latex(blocks=2),
            fit.to_latex(),
        ]
    )
    (tmp_path / "t.tex").write_text(
        f"\\documentclass{{article}}\\usepackage{{booktabs}}\\begin{{document}}\n{tables}\\end{{document}}\n"
    )
    run = subprocess.run(
        ["pdflatex", "-halt-on-error", "-interaction=nonstopmode", "t.tex"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=HANG,
    )
    assert run.returncode == 0, run.stdout[-2000:]
    assert (tmp_path / "t.pdf").stat().st_size > 1000
