"""What was computed is kept, whatever console, disk, signal or another process do; sets of files are whole."""

import errno
import importlib
import os
import signal
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
import yaml
from conftest import ROOT

import smo_gym
from smo_gym import files
from smo_gym.cli import arguments
from smo_gym.cli.commands import COMMANDS

SET = {"results.csv", "runs.csv", "tables.md", "tables.tex", "settings.yaml"}
posix = pytest.mark.skipif(os.name != "posix", reason="of POSIX systems")


def load(name):
    """A command as a module."""
    return importlib.import_module(f"smo_gym.cli.{name}")


def names(folder):
    return {path.name for path in folder.iterdir()}


@pytest.fixture
def short(tmp_path):
    """Arguments of evaluate.py for runs of half a second."""
    changes = {"horizon": {"value": 0.5, "source": "chosen"}}
    own = {"extends": "initial-conditions", **changes}
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(own))
    options = ("--runs", "2", "--controller", "lqr", "--out", str(tmp_path / "out"))
    return ["--config", str(tmp_path / "own.yaml"), *options]


def shell(redirection, command, *options, **environment):
    line = f'"$@" {redirection}'
    program = ["bash", "-c", line, "bash", sys.executable, str(ROOT / "agents" / f"{command}.py"), *options]
    return subprocess.run(program, check=False, capture_output=True, text=True, env=os.environ | environment)


@pytest.mark.slow
@posix
@pytest.mark.parametrize(
    ("redirection", "code"),
    [("| true", 0), ("2>&1 | head -n 1", 0), (">/dev/full", 1), (">&-", 0), (">&- 2>&-", 0), (">&- 2>/dev/full", 0)],
)
def test_the_console_does_not_decide_over_results(short, tmp_path, redirection, code):
    if "/dev/full" in redirection and not Path("/dev/full").exists():
        pytest.skip("there is no /dev/full")
    done = shell(f"{redirection}; exit ${{PIPESTATUS[0]}}", "evaluate", *short)
    assert done.returncode == code
    assert "Traceback" not in done.stderr
    assert "Exception" not in done.stderr
    assert names(tmp_path / "out") == SET
    if code:
        assert done.stderr.endswith(
            "evaluate.py: error: standard output cannot be written to (No space left on device)\n"
        )


@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
def test_a_console_without_a_character_shows_its_code(short, tmp_path, encoding):
    own = tmp_path / "own.yaml"
    own.write_text(own.read_text() + "table: '5 \u03b8\u2192'\n", encoding="utf-8")
    command = [sys.executable, str(ROOT / "agents" / "evaluate.py"), *short]
    done = subprocess.run(command, check=True, capture_output=True, env=os.environ | {"PYTHONIOENCODING": encoding})
    assert rb"\u03b8\u2192" in done.stdout
    assert "\u03b8\u2192" in (tmp_path / "out" / "tables.md").read_text(encoding="utf-8")


@posix
def test_a_command_that_only_prints_says_in_one_line_that_it_cannot():
    done = shell(">/dev/full", "consistency")
    assert done.returncode == 1
    assert done.stderr == "consistency.py: error: standard output cannot be written to (No space left on device)\n"
    assert shell("| true; exit ${PIPESTATUS[0]}", "consistency").stderr == ""


def test_a_package_that_is_not_installed_has_an_unknown_version(short, tmp_path, monkeypatch):
    version = metadata.version

    def missing(name):
        if name in ("smo_gym", "scipy"):
            raise metadata.PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(metadata, "version", missing)
    assert load("evaluate").main(short) == 0
    settings = yaml.safe_load((tmp_path / "out" / "settings.yaml").read_text())
    assert settings["versions"]["scipy"] == "unknown"
    assert settings["versions"]["smo_gym"] == smo_gym.__version__


@posix
@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="needs /proc")
def test_no_open_file_is_renamed(tmp_path, monkeypatch):
    replace = os.replace

    def of_windows(source, target):
        held = [os.path.realpath(f"/proc/self/fd/{number}") for number in os.listdir("/proc/self/fd")]
        assert not any(path == str(source) or path.startswith(f"{source}/") for path in held)
        replace(source, target)

    monkeypatch.setattr(os, "replace", of_windows)
    files.write(tmp_path / "a.csv", "a\n")
    files.write_set(tmp_path, {"a.csv": "b\n", "b.yaml": "b\n"})
    assert names(tmp_path) == {"a.csv", "b.yaml"}


def test_a_full_disk_is_one_line_and_the_tables_are_shown(short, tmp_path, monkeypatch, capsys):
    evaluate = load("evaluate")
    assert evaluate.main(short) == 0
    before = (tmp_path / "out" / "results.csv").read_bytes()
    capsys.readouterr()

    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(files.os, "fsync", full)
    assert evaluate.main([*short, "--seed", "1"]) == 1
    shown = capsys.readouterr()
    results = tmp_path / "out" / "results.csv"
    assert shown.err == f"24 runs to do\nsmo-gym evaluate: error: {results}: No space left on device\n"
    assert "Table 5, LQR" in shown.out
    assert "results are in" not in shown.out
    assert results.read_bytes() == before
    assert names(tmp_path / "out") == SET


def test_what_cannot_be_replaced_is_said_before_the_runs(tmp_path, capsys):
    (tmp_path / "settings.yaml").mkdir()
    assert load("evaluate").main(["--runs", "1e4", "--out", str(tmp_path)]) == 2
    assert f"{tmp_path / 'settings.yaml'} is a folder" in capsys.readouterr().err
    assert load("animate").main(["--out", str(tmp_path / "settings.yaml")]) == 2
    (tmp_path / "x.gif").mkdir()
    assert load("animate").main(["--out", str(tmp_path / "x.gif")]) == 2
    assert "is a folder" in capsys.readouterr().err


KILLED_AT_EVERY_STEP = """
import os, pathlib, shutil, sys, tempfile
from smo_gym import files

OLD, NEW = ({f"{name}": f"{name} {run}" for name in names} for run, names in
            (("old", ("a.csv", "x.json", "figures/f.pdf", "s.yaml")), ("new", ("a.csv", "b.csv", "s.yaml"))))
STEPS = (os, "replace"), (os, "mkdir"), (os, "open"), (os, "fsync"), (os, "unlink"), (os, "rmdir"), (shutil, "rmtree")

def found(folder):
    return {str(p.relative_to(folder)): p.read_text() for p in folder.rglob("*")
            if p.is_file() and ".smo_gym" not in str(p.relative_to(folder))}

def killed(folder, step):
    pid = os.fork()
    if pid == 0:
        count = 0
        def counted(call):
            def dies(*args, **kw):
                nonlocal count
                count += 1
                if count == step:
                    os._exit(9)
                return call(*args, **kw)
            return dies
        for module, name in STEPS:
            setattr(module, name, counted(getattr(module, name)))
        files.write_set(folder, NEW, OLD)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 9

step, ends = 1, set()
while True:
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "mine.txt").write_text("mine")
        files.write_set(folder, OLD)
        again = killed(folder, step)
        seen = found(folder)
        assert seen.pop("mine.txt") == "mine"
        runs = {text.split()[1] for text in seen.values()}
        assert len(runs) <= 1, (step, seen)
        assert "s.yaml" not in seen or seen in (OLD, NEW), (step, seen)
        with files.claimed(folder):
            pass
        seen = found(folder)
        del seen["mine.txt"]
        assert seen in (OLD, NEW), (step, seen)
        ends.add("new" if seen == NEW else "old")
        assert not [p for p in folder.iterdir() if p.name.startswith(".")], step
    if not again:
        break
    step += 1
assert ends == {"old", "new"} and step > 15
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_set_is_whole_or_absent_after_a_kill_at_any_step():
    done = subprocess.run([sys.executable, "-c", KILLED_AT_EVERY_STEP], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_figures_of_older_runs_go_with_their_set(short, tmp_path):
    evaluate = load("evaluate")
    figures = tmp_path / "out" / "figures"
    figures.mkdir(parents=True)
    for name in (evaluate.replaced()[-1], "reference.json", "figures/mine.pdf"):
        (tmp_path / "out" / name).write_text("old")
    assert evaluate.main(short) == 0
    assert names(figures) == {"mine.pdf"}
    assert names(tmp_path / "out") == {*SET, "figures"}


def test_two_commands_do_not_write_to_one_folder(short, tmp_path, capsys):
    evaluate = load("evaluate")
    with files.claimed(tmp_path / "out"):
        assert evaluate.main(short) == 2
    assert "another command is writing there: wait for its end or choose another --out" in capsys.readouterr().err
    assert evaluate.main(short) == 0


@posix
@pytest.mark.parametrize("command", COMMANDS)
def test_an_interruption_while_importing_is_one_line(command, tmp_path):
    (tmp_path / "gymnasium.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    done = subprocess.run(
        [sys.executable, str(ROOT / "agents" / f"{command}.py")],
        check=False,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert (done.returncode, done.stderr) == (130, f"{command}.py: interrupted\n")


@posix
def test_a_parent_that_ignores_interruptions_is_obeyed():
    code = (
        "import signal; from smo_gym.cli import starting; starting.begin(); "
        "assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN"
    )
    subprocess.run(
        [sys.executable, "-c", code],
        check=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
    )


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_says_its_versions(command, capsys):
    assert load(command).main(["--version"]) == 0
    shown = capsys.readouterr().out
    for name in ("python", *arguments.PACKAGES):
        assert f"{name} " in shown


def test_messages_show_a_way_out(short, tmp_path, capsys):
    evaluate = load("evaluate")
    own = tmp_path / "own.yaml"
    own.write_text(own.read_text().replace("initial-conditions", "article.yaml"))
    assert evaluate.main(short) == 2
    message = capsys.readouterr().err
    assert f"{own}: extends='article.yaml' is no file: it must be named as it is found from {tmp_path}/" in message


def test_where_nothing_is_published_nothing_is_counted(short, capsys):
    assert load("evaluate").main([*short, "--uncertainty", "0.123", "--observer", "oracle"]) == 0
    shown = capsys.readouterr().out
    assert "Nothing is published for these runs to compare with." in shown
    assert "0 published" not in shown


@pytest.mark.parametrize(("command", "wanted"), [("upright", {"falls.csv", "falls.md"}), ("theorem", {"theorem.txt"})])
def test_what_is_printed_is_written_too(command, wanted, tmp_path, capsys):
    module = load(command)
    assert module.main(["--runs", "2", "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert names(tmp_path) == wanted
    if command == "theorem":
        assert (tmp_path / "theorem.txt").read_text().split()[:20] == shown.split()[:20]
        assert shown.endswith(f"theorem.txt is in {tmp_path}\n")
    else:
        assert shown.splitlines()[0] == (tmp_path / "falls.md").read_text().splitlines()[0]
        assert (tmp_path / "falls.csv").read_text().startswith("start,uncertainty,arm,falls,runs,fraction,")
