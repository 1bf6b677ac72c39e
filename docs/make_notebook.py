"""Execute docs/notebook.ipynb in place: python docs/make_notebook.py.

Needs `pip install '.[notebook]' nbclient`. What a running widget leaves behind, its state and the address
its viewer was served from, is taken out again: it is of no use once the notebook is closed.
"""

from __future__ import annotations

from pathlib import Path

import nbclient
import nbformat

NOTEBOOK = Path(__file__).with_name("notebook.ipynb")


def main() -> None:
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(notebook, timeout=600).execute()
    notebook.metadata.pop("widgets", None)
    notebook.metadata.language_info = {"name": "python"}
    for cell in notebook.cells:
        cell.metadata = {}
        if cell.cell_type == "code":
            cell.outputs = [output for output in cell.outputs if output.output_type == "execute_result"]
    nbformat.write(notebook, NOTEBOOK)


if __name__ == "__main__":
    main()
