"""The notebooks run as they are, but for shorter training and figures written elsewhere."""

from __future__ import annotations

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = Path(__file__).resolve().parents[1] / "notebooks"
SHORT = {
    "01_rooms": "SPACING = 0.2",
    "02_train": """
SPACING = 0.3
OPTIONS = ["budget=smoke", "data.train_rooms=8", "method.updates.smoke=8", "method.batch=64", "method.warmup_moves=128"]
OPTIONS += ["method.evaluation_moves=5", "budget.evaluations=1", f"runs={FIGURES}"]
""",
    "04_random_starts": "UPDATES = 3",
}


def test_every_notebook_is_known() -> None:
    assert {path.stem for path in NOTEBOOKS.glob("*.ipynb")} == {*SHORT, "03_layouts", "05_tables", "06_planit"}


@pytest.mark.filterwarnings("default")  # of the kernel's, which are not ours
@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_runs_and_writes_its_figures(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(NOTEBOOKS.parent))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    notebook = nbformat.read(path, as_version=4)
    assert notebook.cells[0].cell_type == "markdown"  # what it shows
    parameters = next(k for k, cell in enumerate(notebook.cells) if "parameters" in cell.metadata.get("tags", ()))
    given = f"FIGURES = Path({str(tmp_path)!r})\n{SHORT.get(path.stem, '')}"
    notebook.cells.insert(parameters + 1, nbformat.v4.new_code_cell(given))
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(NOTEBOOKS)}}).execute()
    named = {part for cell in notebook.cells for part in cell.source.split("FIGURES / ")[1:]}
    written = {file.name for file in tmp_path.glob("*.svg")}
    assert len(written) >= len(named) >= 1
    assert all((tmp_path / name).with_suffix(".png").stat().st_size > 5000 for name in written)


def test_no_committed_output_is_large() -> None:
    for path in NOTEBOOKS.glob("*.ipynb"):
        for cell in nbformat.read(path, as_version=4).cells:
            assert all(len(str(output)) < 200_000 for output in cell.get("outputs", ()))
