"""The same bytes from any number of processes, from a cluster, and however often a command is killed."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from smo_gym import cli
from smo_gym.cli import computing, processes
from smo_gym.cli.arguments import Parser
from smo_gym.evaluation import store

ROOT = Path(__file__).resolve().parents[2]
EVALUATE = ROOT / "agents" / "evaluate.py"
posix = pytest.mark.skipif(os.name != "posix", reason="of POSIX systems")


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Arguments of evaluate.py for eighteen pieces of a fraction of a second."""
    path = tmp_path_factory.mktemp("short") / "own.yaml"
    changes = {"horizon": {"value": 0.5, "source": "chosen"}}
    path.write_text(yaml.safe_dump({"extends": str(ROOT / "configs" / "initial-conditions.yaml"), **changes}))
    return ["--config", str(path), "--runs", "260"]


@pytest.fixture(scope="module")
def wanted(short, tmp_path_factory):
    """The files of an undisturbed run."""
    out = tmp_path_factory.mktemp("whole")
    assert ended(begun(short, out)) == (0, [])
    return read(out)


def begun(options, out, **more):
    """A command that runs; Ctrl-C is for it and its workers alone."""
    command = [sys.executable, str(EVALUATE), *options, "--out", str(out)]
    pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    return subprocess.Popen(command, cwd=out.parent, **pipes, **more)


def ended(process):
    """Its exit code, and what it has said but for how many runs there are."""
    _, shown = process.communicate()
    return process.returncode, shown.splitlines()[1:]


def read(out):
    """All files of a folder; the settings name the folder itself."""
    files = {path.name: path.read_text() for path in out.iterdir()}
    return files | {"settings.yaml": files["settings.yaml"].replace(str(out), "OUT")}


def stamps(out):
    """Which group's file is which: one that is written again has another number or time."""
    found = {}
    for path in (out / store.FOLDER).glob(f"*{store.SUFFIX}"):
        stat = path.stat()
        found[path.name] = stat.st_ino, stat.st_mtime_ns
    return found


def until(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def workers(process):
    """Process ids of a command's workers."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            told = path.read_text().rsplit(")", 1)[1].split()
            line = path.with_name("cmdline").read_bytes()
        except (OSError, IndexError):
            continue
        if int(told[1]) == process.pid and b"spawn_main" in line:
            found.append(int(path.parent.name))
    return found


def test_workers_give_the_same_bytes(short, wanted, tmp_path):
    out = tmp_path / "out"
    assert ended(begun([*short, "--workers", "2"], out)) == (0, [])
    assert read(out) == wanted


@posix
@pytest.mark.parametrize("count", [1, 2])
def test_a_command_that_is_killed_goes_on_and_runs_no_group_twice(short, wanted, tmp_path, count):
    out = tmp_path / "out"
    options = [*short, "--workers", str(count)]
    known = {}
    for more in (1, 4):
        process, least = begun(options, out), len(known) + more
        until(lambda least=least: len(stamps(out)) >= least)
        process.kill()
        process.communicate()
        assert known.items() <= stamps(out).items()
        known = stamps(out)
        assert known
    assert ended(begun(options, out)) == (0, [])
    assert read(out) == wanted


@posix
@pytest.mark.slow
def test_kills_at_any_moment_lose_nothing(short, wanted, tmp_path):
    out, generator, known = tmp_path / "out", random.Random(0), {}
    for _ in range(12):
        process = begun([*short, "--workers", "2"], out)
        try:
            process.communicate(timeout=generator.uniform(0.0, 8.0))
            break
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
        if (out / "settings.yaml").exists():
            break  # the results are whole: what was kept for them may go
        assert known.items() <= stamps(out).items()
        known = stamps(out)
    assert ended(begun([*short, "--workers", "2"], out)) == (0, [])
    assert read(out) == wanted


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize("kind", ["killed", "interrupted"])
def test_what_is_done_is_kept_when_workers_or_the_command_are_stopped(short, wanted, tmp_path, kind):
    out = tmp_path / "out"
    process = begun([*short, "--workers", "2"], out, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    until(lambda: stamps(out))
    theirs = workers(process)
    assert len(theirs) == 2
    if kind == "killed":
        os.kill(theirs[0], signal.SIGKILL)
    else:
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does, to all of them
    code, line = {"killed": (1, f"error: {processes.ENDED}; "), "interrupted": (130, "interrupted, ")}[kind]
    assert ended(process) == (code, [f"evaluate.py: {line}{computing.AGAIN}"])
    assert stamps(out)
    assert not [pid for pid in theirs if Path(f"/proc/{pid}").exists()]
    assert ended(begun(short, out)) == (0, [])
    assert read(out) == wanted


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_workers_end_with_a_command_that_is_killed(short, tmp_path):
    out = tmp_path / "out"
    process = begun([*short, "--workers", "2"], out)
    until(lambda: stamps(out))
    theirs = workers(process)
    process.kill()
    process.communicate()
    until(lambda: not [pid for pid in theirs if Path(f"/proc/{pid}").exists()], 10.0)


def test_code_of_ones_own_is_there_in_workers(short, tmp_path):
    (tmp_path / "mine.py").write_text(
        "import gymnasium\n"
        "from smo_gym import LQR\n\n"
        "gymnasium.register('Mine-v0', entry_point='smo_gym.envs.pendulum:PendulumEnv',\n"
        "                   vector_entry_point='smo_gym.envs.vector:PendulumVectorEnv')\n\n"
        "def Mine():\n    return LQR([1.0, 0.0, 1.0, 0.0])\n"
    )
    own = tmp_path / "own.yaml"
    own.write_text(Path(short[1]).read_text() + "environment: Mine-v0\n")
    options = ["--config", str(own), "--import", "mine", "--controller", "lqr", "mine:Mine", "--runs", "2"]
    for count in ("1", "2"):
        assert ended(begun([*options, "--workers", count], tmp_path / count))[0] == 0
    assert read(tmp_path / "1") == read(tmp_path / "2")


def broken(piece):
    raise ValueError(f"piece {piece} cannot be done")


def test_an_error_in_a_worker_is_that_of_the_command():
    with pytest.raises(ValueError, match="piece 1 cannot be done") as raised:
        list(processes.in_processes(3, broken, [1]))
    assert "in a worker:\nTraceback" in raised.value.__notes__[0]
    assert list(processes.in_processes(2, broken, [])) == []
    assert sorted(processes.in_processes(2, abs, [-3, 1, -2])) == [1, 2, 3]


def test_a_worker_of_other_code_is_refused():
    ours = store.code()
    with pytest.raises(ValueError, match="a worker has another numpy than this command: give all the same"):
        computing._prepare(1, (), os.getcwd(), tuple({**ours, "numpy": "0"}.items()))


def test_two_places_are_refused_and_a_cluster_needs_its_extra(tmp_path, monkeypatch):
    parser = Parser("", "")
    computing.add(parser)
    args = parser.parse_args(["--workers", "2", "--dask", "tcp://127.0.0.1:1"])
    with pytest.raises(ValueError, match="--workers 2 is of this machine, --dask tcp"), computing.computing(args, None):
        pass
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.delitem(sys.modules, "smo_gym.cli.cluster", raising=False)
    monkeypatch.delattr(cli, "cluster", raising=False)  # which the import statement finds before
    args = parser.parse_args(["--dask", "tcp://127.0.0.1:1"])
    with pytest.raises(ImportError, match=r'pip install "smo_gym\[dask\]"'), computing.computing(args, tmp_path):
        pass


@pytest.mark.parametrize("address", ["nonsense", "foo://127.0.0.1:1"])
def test_an_address_of_no_scheduler_is_named(address):
    pytest.importorskip("distributed")
    from smo_gym.cli import cluster

    with pytest.raises(ValueError, match=f"--dask {address}: no scheduler answers there"), cluster.mapping(address):
        pass


CLUSTER = """
import sys
from distributed import LocalCluster

if __name__ == "__main__":
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "host": "127.0.0.1"}
    with LocalCluster(**options) as cluster:
        print(cluster.scheduler_address, *(worker.pid for worker in cluster.workers.values()), flush=True)
        sys.stdin.read()
"""


@posix
@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_gives_the_same_bytes(short, wanted, tmp_path):
    pytest.importorskip("distributed")
    (tmp_path / "local.py").write_text(CLUSTER)
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "text": True}
    with subprocess.Popen([sys.executable, str(tmp_path / "local.py")], **pipes) as cluster:
        try:
            address, first, _ = cluster.stdout.readline().split()
            process = begun([*short, "--dask", address], tmp_path / "out")
            until(lambda: stamps(tmp_path / "out") or process.poll() is not None)
            os.kill(int(first), signal.SIGKILL)
            done = ended(process)
        finally:
            cluster.stdin.close()
    assert done == (0, [])
    assert read(tmp_path / "out") == wanted
