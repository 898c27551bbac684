"""Kill a measurement at random moments and go on each time: what the end has to do with one that was left alone.

python benchmarks/kills.py --runs 500 --kills 30
"""

import argparse
import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

EVALUATE = Path(__file__).resolve().parent.parent / "agents" / "evaluate.py"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", default="500")
    parser.add_argument("--workers", default="2")
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    args, others = parser.parse_known_args()  # such as --scenario tracking
    generator = random.Random(args.seed)
    command = [sys.executable, str(EVALUATE), "--runs", args.runs, "--workers", args.workers, "--out", "out", *others]
    with tempfile.TemporaryDirectory() as name:
        alone, killed = Path(name) / "alone", Path(name) / "killed"
        seconds = finished(command, alone)
        print(f"left alone: {seconds:.0f} s", flush=True)
        kills = ends = again = 0
        alike = True
        while kills < args.kills or ends == 0:
            killed.mkdir(exist_ok=True)
            known = groups(killed)
            process = subprocess.Popen(command, cwd=killed, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            try:
                process.wait(generator.uniform(0.0, 0.7 * seconds) if kills < args.kills else None)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                kills += 1
                now = groups(killed)
                if not (killed / "out" / "settings.yaml").exists():  # then the kept groups may go
                    again += sum(now.get(name) != stamp for name, stamp in known.items())
                print(f"kill {kills}: {len(now) - len(known)} groups more, {len(now)} are kept", flush=True)
            else:
                alike &= process.returncode == 0 and files(alone) == files(killed)
                ends += 1
                print(
                    f"end {ends}: the files are {'' if alike else 'NOT '}those of a run that was left alone", flush=True
                )
                shutil.rmtree(killed)
    print(f"{kills} kills, {ends} ends; groups that were kept and run again: {again}")
    sys.exit(0 if alike and not again else 1)


def finished(command: list[str], folder: Path) -> float:
    """Seconds that a command takes."""
    folder.mkdir()
    began = time.monotonic()
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return time.monotonic() - began


def groups(folder: Path) -> dict[str, tuple[int, int]]:
    """The files of finished groups: one that is written again has another number and time."""
    found = sorted(folder.glob("out/.groups/*.group"))
    return {path.name: (path.stat().st_ino, path.stat().st_mtime_ns) for path in found}


def files(folder: Path) -> dict[str, bytes]:
    """All files of results."""
    return {path.name: path.read_bytes() for path in sorted((folder / "out").rglob("*")) if path.is_file()}


if __name__ == "__main__":
    main()
