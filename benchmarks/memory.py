"""Peak memory of a measurement with many runs.

python benchmarks/memory.py
"""

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

EVALUATE = Path(__file__).resolve().parent.parent / "agents" / "evaluate.py"


def main() -> None:
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, str(EVALUATE), "--controller", "lqr", "--scenario", "initial-conditions"]
        subprocess.run([*command, "--runs", "1000", "--out", out], check=True, capture_output=True)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"four cells of Table 5, both arms, 1000 runs each (8000 plants at once): {peak:.0f} MB at the peak")


if __name__ == "__main__":
    main()
