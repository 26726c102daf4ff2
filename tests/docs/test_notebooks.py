"""The notebook of docs/examples is run as it stands, in an empty folder; it is stored without results."""

from __future__ import annotations

import os
from pathlib import Path

import nbclient
import nbformat
import pytest
from campaign import campaign

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOK = ROOT / "docs" / "examples" / "notebook.ipynb"


def test_stored_without_results() -> None:
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in code)
    lines = code[-1].source.splitlines()
    assert len(lines) - max(k for k, line in enumerate(lines) if line.startswith(("import", "from"))) - 2 == 5  # beside imports


@campaign
def test_runs_to_a_verdict_a_table_and_a_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = notebook.cells[3].outputs
    verdict, table, figure = (output["data"] for output in shown if "data" in output)
    assert any(verdict["text/html"].count(answer) for answer in ("Yes.", "With care.")), verdict["text/html"][:300]
    assert "ZZ<sub>1R</sub>" in table["text/html"] and "relative error" in table["text/html"]
    assert figure["image/svg+xml"].lstrip().startswith(("<?xml", "<svg"))
