"""The notebooks run from their first cell to their last, and are stored without outputs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from doc_pages import ROOT

nbformat: Any = pytest.importorskip("nbformat", reason="nbclient (extra `test`) is not installed")

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


def read(path: Path) -> Any:
    return nbformat.read(path, as_version=4)


def outputs_of(notebook: Any) -> list[Any]:
    return [output for cell in notebook.cells for output in cell.get("outputs", [])]


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path) -> None:
    """In its own folder, as a reader runs it."""
    nbclient = pytest.importorskip("nbclient", reason="nbclient (extra `test`) is not installed")
    notebook = read(path)
    where = {"metadata": {"path": str(path.parent)}}

    nbclient.NotebookClient(notebook, timeout=600, resources=where).execute()

    found = outputs_of(notebook)
    assert [] == [output.text for output in found if output.get("name") == "stderr"]
    kinds = {kind for output in found for kind in output.get("data", {})}
    assert {"text/html", "image/png"} <= kinds


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_as_it_was_written(path: Path) -> None:
    """Without outputs and counts, which would change at each run."""
    notebook = read(path)

    nbformat.validate(notebook)
    assert [] == outputs_of(notebook)
    assert {None} == {cell.get("execution_count") for cell in notebook.cells}
    assert "markdown" == notebook.cells[0].cell_type


def test_there_are_notebooks() -> None:
    """So that a change of folders does not silently run none."""
    assert 3 <= len(NOTEBOOKS)
