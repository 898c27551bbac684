"""smo-gym, python -m smo_gym and the files of agents/ are one: same output, same codes, each under its own name."""

import importlib
import os
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from smo_gym.cli import commands, starting
from smo_gym.cli.commands import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
MODULE = [sys.executable, "-m", "smo_gym"]
SHARED = {
    "answer",
    "arguments",
    "between",
    "cluster",
    "commands",
    "computing",
    "console",
    "entry",
    "laws_besides",
    "likelihoods",
    "narrow",
    "processes",
    "progress",
    "real",
    "recording",
    "starting",
    "tune_laws",
}
posix = pytest.mark.skipif(os.name != "posix", reason="of POSIX systems")


@pytest.fixture(scope="session")
def script(tmp_path_factory):
    """smo-gym as an installer writes it."""
    ((name, entry),) = SCRIPTS.items()
    module, _, function = entry.partition(":")
    path = tmp_path_factory.mktemp("bin") / name
    path.write_text(f"import sys\nfrom {module} import {function}\nsys.exit({function}())\n")
    return [sys.executable, str(path)]


def run(*command, path=(), **options):
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([*map(str, path), str(ROOT)])}
    return subprocess.run(command, check=False, capture_output=True, text=True, env=environment, **options)


def test_every_command_is_a_module_with_a_file_in_agents():
    assert {path.stem for path in (ROOT / "smo_gym" / "cli").glob("[!_]*.py")} == {*COMMANDS, *SHARED}
    assert {path.stem for path in (ROOT / "agents").glob("*.py")} == {*COMMANDS}
    for name in COMMANDS:
        shim = (ROOT / "agents" / f"{name}.py").read_text()
        assert f"from smo_gym.cli.{name} import main\n" in shim
        assert callable(importlib.import_module(f"smo_gym.cli.{name}").main)


def test_all_three_do_the_same(script):
    done = [run(*start, "--all") for start in ([*script, "consistency"], [*MODULE, "consistency"])]
    done.append(run(sys.executable, str(ROOT / "agents" / "consistency.py"), "--all"))
    assert {(process.returncode, process.stdout, process.stderr) for process in done} == {(0, done[0].stdout, "")}
    assert "133 of 138 printed numbers follow" in done[0].stdout


@pytest.mark.parametrize(
    ("start", "name", "line"),
    [
        (["smo-gym", "evaluate"], "smo-gym evaluate", "smo-gym evaluate"),
        (["-m", "evaluate"], "python -m smo_gym evaluate", "python -m smo_gym evaluate"),
        (["agents/evaluate.py"], "evaluate.py", "python agents/evaluate.py"),
    ],
)
def test_messages_have_the_name_that_was_typed(script, start, name, line):
    begin = {"smo-gym": script, "-m": MODULE}.get(start[0], [sys.executable, str(ROOT / start[0])])
    refused = run(*begin, *start[1:], "--runs", "0")
    assert refused.returncode == 2
    assert refused.stderr == f"{name}: error: argument --runs: '0' must be a whole number of at least 1\n"
    shown = run(*begin, *start[1:], "--help")
    assert shown.stdout.startswith(f"usage: {name} [-h]")
    assert f"    {line} --controller all --scenario all\n" in shown.stdout


def test_in_another_program_a_command_has_its_name_of_smo_gym(monkeypatch, capsys):
    for program in ("/usr/bin/pytest", "", "/somewhere/agents/train.py", str(ROOT / "agents" / "my_own.py")):
        monkeypatch.setattr(sys, "argv", [program])
        assert starting.program() is None
        assert not starting.is_command()
        assert commands.main(["evaluate", "--observer", "oracel"]) == 2
        assert capsys.readouterr().err.startswith("smo-gym evaluate: error: unknown observer 'oracel'")
    monkeypatch.setattr(sys, "argv", [str(ROOT / "agents" / "train.py")])
    assert starting.program() == "train.py"
    assert not starting.is_command()  # a process that a command starts has its arguments, but was not started by them


def test_what_is_no_command_is_one_line(script):
    shown = run(*script, "--help")
    assert (shown.returncode, shown.stderr) == (0, "")
    for name, what in COMMANDS.items():
        assert any(line.split(maxsplit=1) == [name, what] for line in shown.stdout.splitlines())
    version = run(*script, "--version")
    assert (version.returncode, version.stdout) == (0, run(*script, "theorem", "--version").stdout)
    slip = run(*script, "evalaute", "--runs", "2")
    assert slip.returncode == 2
    (said,) = slip.stderr.splitlines()
    assert said.startswith("smo-gym: error: argument COMMAND: unknown command 'evalaute': did you mean 'evaluate'? ")
    assert run(*script).stderr == "smo-gym: error: the following arguments are required: COMMAND\n"


def imported(*arguments):
    """The modules that are there after a command."""
    code = f"import sys\nfrom smo_gym.cli.commands import main\nmain({list(arguments)})\nprint(*sys.modules)"
    return {*run(sys.executable, "-c", code).stdout.splitlines()[-1].split()}


def test_only_what_is_wanted_is_imported():
    without = imported("--help")
    assert not without & {"scipy.stats", "pydantic", *(f"smo_gym.cli.{name}" for name in COMMANDS)}
    wanted = imported("evaluate", "--help")
    assert {f"smo_gym.cli.{name}" for name in COMMANDS} & wanted == {"smo_gym.cli.evaluate"}
    assert not wanted & {"torch", "stable_baselines3", "matplotlib", "plotly", "casadi", "cma", "pygame"}


@posix
@pytest.mark.parametrize("module", ["gymnasium", "tabulate"])  # of the package, of the command alone
def test_an_interruption_while_importing_is_one_line(script, module, tmp_path):
    (tmp_path / f"{module}.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    for name, start in (("smo-gym", script), ("python -m smo_gym", MODULE)):
        done = run(
            *start,
            "consistency",
            path=[tmp_path],
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        assert (done.returncode, done.stderr) == (130, f"{name}: interrupted\n")


def test_another_program_keeps_its_own_interruption():
    code = "import signal, smo_gym; assert signal.getsignal(signal.SIGINT) is signal.default_int_handler"
    assert run(sys.executable, "-c", code).returncode == 0


@posix
def test_closed_consoles_stop_nothing(script, tmp_path):
    for start in (script, MODULE):
        out = tmp_path / start[-1].strip("/").replace("/", "-")
        line = ["bash", "-c", '"$@" >&- 2>&-', "bash", *start, "theorem", "--runs", "2", "--out", str(out)]
        assert run(*line).returncode == 0
        assert "designed" in (out / "theorem.txt").read_text()


def test_common_arguments_are_read_alike():
    parser = commands.Parser("evaluate", "smo-gym evaluate, not smo-gym-evaluate.")
    parser.runs(10, "plants", ", as ever")
    parser.seed("the plants")
    parser.out(None)
    read = parser.parse_args(["--runs", "1e2", "--out", "x"])
    assert (read.runs, read.seed, read.out) == (100, 0, Path("x"))
    text = parser.format_help()
    for told in ("plants (default 10, as ever)", "of the plants (default 0)", "folder (default: none)"):
        assert told in text
