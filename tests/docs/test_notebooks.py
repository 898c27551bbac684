"""The notebooks run from top to bottom in a fresh kernel, and are committed without their outputs."""

import sys

import nbformat
import pytest
from conftest import ROOT
from jupyter_client import AsyncKernelManager
from jupyter_client.kernelspec import KernelSpecManager
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

FOLDER = ROOT / "notebooks"
NEEDS = {"03-learning": ("stable_baselines3", "sb3_contrib", "torch")}
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
SHORTER = {
    "03-learning": {"steps = 120_000": "steps = 12_800", "runs = 200": "runs = 20"}
}  # all cells run, for less long
CELL_LIMIT = 300  # s; a kernel that hangs must not hang the tests


class ThisInterpreter(AsyncKernelManager):
    """Of kernels it knows only the running interpreter's own, whatever is installed on the machine."""

    def __init__(self, **options):
        super().__init__(kernel_spec_manager=KernelSpecManager(kernel_dirs=[]), **options)


def read(path):
    return nbformat.read(path, as_version=4)


def execute(notebook):
    """Run all cells in place; fails with the cell that raised."""
    try:
        NotebookClient(
            notebook,
            timeout=CELL_LIMIT,
            kernel_name="python3",
            kernel_manager_class=ThisInterpreter,
            resources={"metadata": {"path": str(FOLDER)}},
        ).execute()
    except CellExecutionError as error:
        last = next(i for i, cell in reversed(list(enumerate(notebook.cells))) if cell.get("execution_count"))
        pytest.fail(f"cell {last} raised {error.ename}: {error.evalue}\n\n{notebook.cells[last].source}", pytrace=False)


def test_there_are_three():
    assert [path.stem for path in NOTEBOOKS] == ["01-the-article", "02-the-observer", "03-learning"]


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path):
    for module in NEEDS.get(path.stem, ()):
        pytest.importorskip(module, reason='needs pip install "smo_gym[rl]"')
    notebook = read(path)
    for long, short in SHORTER.get(path.stem, {}).items():
        (cell,) = (cell for cell in notebook.cells if long in cell.source)
        cell.source = cell.source.replace(long, short)
    execute(notebook)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not [output.text for output in outputs if output.get("name") == "stderr" and "Warning" in output.text]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_committed_without_outputs(path):
    notebook = read(path)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        assert cell.get("outputs", []) == []
        assert cell.get("execution_count") is None
    assert path.stat().st_size < 40_000


def test_a_failing_cell_is_named():
    cells = [nbformat.v4.new_code_cell("x = 1"), nbformat.v4.new_code_cell("x / 0")]
    with pytest.raises(pytest.fail.Exception, match=r"cell 1 raised ZeroDivisionError: division by zero\n\nx / 0"):
        execute(nbformat.v4.new_notebook(cells=cells))


def test_the_kernel_is_the_running_interpreter(tmp_path, monkeypatch):
    decoy = tmp_path / "kernels" / "python3"
    decoy.mkdir(parents=True)
    (decoy / "kernel.json").write_text('{"argv": ["/nonexistent"], "display_name": "decoy", "language": "python"}')
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path))
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("import sys; print(sys.executable)")])
    execute(notebook)
    assert notebook.cells[0].outputs[0].text.strip() == sys.executable
