"""The notebooks run as they are, but for shorter training and figures written elsewhere."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import nbformat
import pytest
from matplotlib import rc_context
from nbclient import NotebookClient
from nbformat import NotebookNode

NOTEBOOKS = Path(__file__).resolve().parents[1] / "notebooks"
SHORT = {
    "01_rooms": "SPACING = 0.2",
    "02_train": """
SPACING, COMPARED = 0.3, 2
OPTIONS = ["budget=smoke", "data.train_rooms=8", "method.updates.smoke=8", "method.batch=64", "method.warmup_moves=128"]
OPTIONS += ["method.evaluation_moves=5", "budget.evaluations=1", f"runs={FIGURES}"]
""",
    "04_random_starts": "UPDATES = 3",
    "07_whole_rooms": "SECONDS, DESIGNED = 0.1, 5",
}


def test_every_notebook_is_known() -> None:
    assert {path.stem for path in NOTEBOOKS.glob("*.ipynb")} == {*SHORT, "03_layouts", "05_tables", "06_planit"}


def given(path: Path, folder: Path) -> NotebookNode:
    """The notebook with other parameters, and its figures in a folder."""
    notebook = nbformat.read(path, as_version=4)
    assert notebook.cells[0].cell_type == "markdown"  # what it shows
    parameters = next(k for k, cell in enumerate(notebook.cells) if "parameters" in cell.metadata.get("tags", ()))
    cell = nbformat.v4.new_code_cell(f"FIGURES = Path({str(folder)!r})\n{SHORT.get(path.stem, '')}")
    notebook.cells.insert(parameters + 1, cell)
    return notebook


def assert_figures_are_written(notebook: NotebookNode, folder: Path) -> None:
    named = {part for cell in notebook.cells for part in cell.source.split("FIGURES / ")[1:]}
    pictures, drawings = (list(folder.glob(f"*.{suffix}")) for suffix in ("png", "svg"))
    assert len(pictures) >= len(named) >= 1
    assert all(file.stat().st_size > 5000 for file in pictures)
    assert len(drawings) >= sum(".png" not in part.partition(")")[0] for part in named)  # of all that `save` writes
    assert all(file.with_suffix(".png") in pictures for file in drawings)


@pytest.mark.filterwarnings("ignore:FigureCanvasAgg is non-interactive")
@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_runs_and_writes_its_figures(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its cells one after the other, in this process: a kernel would import for seconds."""
    monkeypatch.chdir(NOTEBOOKS)
    monkeypatch.setattr("sys.path", [*sys.path])
    notebook, names = given(path, tmp_path), {"__name__": "__main__"}
    with rc_context():
        for cell in notebook.cells:
            if cell.cell_type == "code":
                exec(compile(cell.source, path.name, "exec"), names)
        plt.close("all")
    assert_figures_are_written(notebook, tmp_path)


@pytest.mark.filterwarnings("default")  # of the kernel's, which are not ours
def test_a_kernel_runs_a_notebook(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As notebooks/run.py has it: one is enough to hold that the kernel finds the project."""
    monkeypatch.setenv("PYTHONPATH", str(NOTEBOOKS.parent))
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    notebook = given(NOTEBOOKS / "01_rooms.ipynb", tmp_path)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(NOTEBOOKS)}}).execute()
    assert_figures_are_written(notebook, tmp_path)


def test_no_committed_output_is_large() -> None:
    for path in NOTEBOOKS.glob("*.ipynb"):
        for cell in nbformat.read(path, as_version=4).cells:
            assert all(len(str(output)) < 200_000 for output in cell.get("outputs", ()))
