"""The notebooks run from top to bottom in a fresh kernel, and are committed with what they then show."""

import sys

import nbformat
import pytest
from conftest import ROOT
from nbclient.exceptions import CellExecutionError

FOLDER = ROOT / "notebooks"
sys.path.append(str(FOLDER))
from run import execute, pictures  # noqa: E402

NEEDS = {"03-learning": ("stable_baselines3", "sb3_contrib", "torch")}
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
SHORTER = {
    "03-learning": {"steps = 120_000": "steps = 12_800", "runs = 200": "runs = 20"}
}  # all cells run, for less long
REAL, WHERE, DATA = "05-a-real-pendulum", "SMO_GYM_DATA", ROOT.parent / "shared" / "data"
LIMIT = 400_000  # bytes


def read(path):
    return nbformat.read(path, as_version=4)


def run_through(notebook):
    """Run all cells in place; fails with the cell that raised."""
    try:
        execute(notebook)
    except CellExecutionError as error:
        last = next(i for i, cell in reversed(list(enumerate(notebook.cells))) if cell.get("execution_count"))
        pytest.fail(f"cell {last} raised {error.ename}: {error.evalue}\n\n{notebook.cells[last].source}", pytrace=False)


def told(notebook):
    """What the cells say in words, numbers and tables; of a picture, that there is one."""
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            yield output.get("text") or data.get("text/markdown") or ("image/png" in data)


@pytest.fixture(autouse=True)
def recordings(monkeypatch):
    """Those beside this checkout, where there are some."""
    monkeypatch.delenv(WHERE, raising=False)
    if DATA.is_dir():
        monkeypatch.setenv(WHERE, str(DATA))


def test_there_are_five():
    names = ["01-the-article", "02-the-observer", "03-learning", "04-what-an-encoder-does", REAL]
    assert [path.stem for path in NOTEBOOKS] == names


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path):
    for module in NEEDS.get(path.stem, ()):
        pytest.importorskip(module, reason='needs pip install "smo_gym[rl]"')
    notebook = read(path)
    for long, short in SHORTER.get(path.stem, {}).items():
        (cell,) = (cell for cell in notebook.cells if long in cell.source)
        cell.source = cell.source.replace(long, short)
    committed = list(told(notebook))
    run_through(notebook)
    if path.stem in SHORTER or (path.stem == REAL and not DATA.is_dir()):
        assert len(list(told(notebook))) == len(committed)
    else:
        assert list(told(notebook)) == committed
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not [output.text for output in outputs if output.get("name") == "stderr" and "Warning" in output.text]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_committed_as_executed(path):
    notebook = read(path)
    nbformat.validate(notebook)
    counts = [cell.execution_count for cell in notebook.cells if cell.cell_type == "code"]
    assert counts == list(range(1, len(counts) + 1))
    assert path.stat().st_size < LIMIT
    shown = list(pictures(notebook))
    assert len(shown) > 1
    for cell, _ in shown:
        assert len(cell.metadata.alt) > 30


@pytest.mark.slow
def test_a_twin_stands_in_for_the_recordings_of_the_real_pendulum(monkeypatch):
    monkeypatch.delenv(WHERE, raising=False)
    notebook = read(FOLDER / f"{REAL}.ipynb")
    committed = list(told(notebook))
    assert committed[0].startswith("30 recordings of the real cart pole")
    assert str(DATA) not in "".join(map(str, committed))
    run_through(notebook)
    instead = list(told(notebook))
    assert instead[0].startswith(f"{WHERE} is not set: 30 runs of a synthetic twin")
    assert len(instead) == len(committed)


def test_a_failing_cell_is_named():
    cells = [nbformat.v4.new_code_cell("x = 1"), nbformat.v4.new_code_cell("x / 0")]
    with pytest.raises(pytest.fail.Exception, match=r"cell 1 raised ZeroDivisionError: division by zero\n\nx / 0"):
        run_through(nbformat.v4.new_notebook(cells=cells))


def test_the_kernel_is_the_running_interpreter(tmp_path, monkeypatch):
    decoy = tmp_path / "kernels" / "python3"
    decoy.mkdir(parents=True)
    (decoy / "kernel.json").write_text('{"argv": ["/nonexistent"], "display_name": "decoy", "language": "python"}')
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path))
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("import sys; print(sys.executable)")])
    run_through(notebook)
    assert notebook.cells[0].outputs[0].text.strip() == sys.executable
