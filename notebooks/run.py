"""Run the notebooks and keep what they show, but not when: python notebooks/run.py [03_layouts 05_tables]"""

from __future__ import annotations

import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

HERE = Path(__file__).parent

known = {path.stem: path for path in sorted(HERE.glob("*.ipynb"))}
if unknown := [name for name in sys.argv[1:] if name not in known]:
    sys.exit(f"{unknown[0]}: expected notebooks, by name: {', '.join(known)}")
for path in [known[name] for name in sys.argv[1:] or known]:
    print(path.stem, flush=True)
    notebook = nbformat.read(path, as_version=4)
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)  # its times
    where = {"metadata": {"path": str(HERE)}}
    NotebookClient(notebook, timeout=None, record_timing=False, coalesce_streams=True, resources=where).execute()
    nbformat.write(notebook, path)
