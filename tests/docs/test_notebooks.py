"""The notebooks of docs/examples are run as they stand, in an empty folder; they are stored without
results.
"""

from __future__ import annotations

import os
from pathlib import Path

import nbclient
import nbformat
import pytest
from campaign import campaign
from hang import HANG

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOK = ROOT / "docs" / "examples" / "notebook.ipynb"
TEACHING = ROOT / "docs" / "examples" / "two_link_arm.ipynb"


def test_stored_without_results() -> None:
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in code)
    lines = code[-1].source.splitlines()
    assert (
        len(lines)
        - max(k for k, line in enumerate(lines) if line.startswith(("import", "from")))
        - 2
        == 5
    )  # beside imports


@campaign
def test_runs_to_a_verdict_a_table_and_a_figure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(
        notebook,
        timeout=HANG,
        kernel_name="python3",
        resources={"metadata": {"path": str(tmp_path)}},
    ).execute()
    shown = notebook.cells[3].outputs
    verdict, table, figure = (output["data"] for output in shown if "data" in output)
    assert any(verdict["text/html"].count(answer) for answer in ("Yes.", "Yes, ", "With care.")), (
        verdict["text/html"][:300]
    )
    assert "ZZ<sub>1R</sub>" in table["text/html"] and "relative error" in table["text/html"]
    assert figure["image/svg+xml"].lstrip().startswith(("<?xml", "<svg"))


def test_teaching_notebook_is_stored_without_results() -> None:
    notebook = nbformat.read(TEACHING, as_version=4)
    nbformat.validate(notebook)
    assert not any(
        cell.outputs or cell.execution_count for cell in notebook.cells if cell.cell_type == "code"
    )


@campaign
def test_two_link_arm_proves_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every check of the teaching notebook is True, its rank is 6, its formulas are typeset; the
    page of the site is made from the same cells.
    """
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
    notebook = nbformat.read(TEACHING, as_version=4)
    nbclient.NotebookClient(
        notebook,
        timeout=HANG,
        kernel_name="python3",
        resources={"metadata": {"path": str(tmp_path)}},
    ).execute()
    shown = {
        cell.id: [o.get("data", {}) for o in cell.outputs]
        for cell in notebook.cells
        if cell.cell_type == "code"
    }
    assert all(
        shown[cell][-1]["text/plain"] == "True"
        for cell in ("derivative", "by-lagrange", "relation", "regrouping")
    )
    assert (
        shown["skew"][-1]["text/plain"] == "(True, True)" and shown["rank"][-1]["text/plain"] == "6"
    )
    assert (
        r"\begin{aligned}" in shown["inertia"][-1]["text/latex"]
        and r"\mathbf{C}_{2,1}" in shown["coriolis"][-1]["text/latex"]
    )
