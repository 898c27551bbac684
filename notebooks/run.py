"""Run the notebooks and keep what they show, small: ``python notebooks/run.py``, or with the names of some.

A picture's description for those who do not see it stands in its cell's metadata, as ``alt``, so that a run keeps it.
"""

import base64
import io
import sys
from pathlib import Path

import nbformat
from jupyter_client import AsyncKernelManager
from jupyter_client.kernelspec import KernelSpecManager
from nbclient import NotebookClient
from PIL import Image

FOLDER = Path(__file__).parent
CELL_LIMIT = 300  # s; a kernel that hangs must not hang what waits for it
COLOURS = 64  # of a picture: lines and letters need no more, and the file is a quarter


class ThisInterpreter(AsyncKernelManager):
    """Of kernels it knows only the running interpreter's own, whatever is installed on the machine."""

    def __init__(self, **options):
        super().__init__(kernel_spec_manager=KernelSpecManager(kernel_dirs=[]), **options)


def execute(notebook):
    """Run all cells in place, and leave in it nothing of this machine and hour."""
    NotebookClient(
        notebook,
        timeout=CELL_LIMIT,
        kernel_name="python3",
        kernel_manager_class=ThisInterpreter,
        resources={"metadata": {"path": str(FOLDER)}},
        record_timing=False,
        coalesce_streams=True,
    ).execute()
    notebook.metadata["language_info"] = {"name": "python"}


def pictures(notebook):
    """Every output that has a picture, with its cell."""
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            if "image/png" in output.get("data", {}):
                yield cell, output


def shrink(notebook):
    """Give every picture a palette."""
    for _, output in pictures(notebook):
        picture = Image.open(io.BytesIO(base64.b64decode(output.data["image/png"]))).convert("RGB")
        file = io.BytesIO()
        picture.quantize(COLOURS, dither=Image.Dither.NONE).save(file, "PNG", optimize=True)
        output.data["image/png"] = base64.b64encode(file.getvalue()).decode()


if __name__ == "__main__":
    for path in [FOLDER / name for name in sys.argv[1:]] or sorted(FOLDER.glob("*.ipynb")):
        run = nbformat.read(path, as_version=4)
        execute(run)
        shrink(run)
        nbformat.write(run, path)
