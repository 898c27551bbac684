"""A report for the site, of a few runs: what ``--report`` writes."""

import contextlib
import functools
import io
import tempfile
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from smo_gym.cli.commands import main

COMMAND = "evaluate --controller all --scenario regulation --uncertainty 0.2 --runs 50"


def on_files(files: Files, config: MkDocsConfig, **kwargs: Any) -> Files:
    """Add the report."""
    files.append(File.generated(config, "report.html", content=_report()))
    return files


@functools.cache
def _report() -> str:
    silent = io.StringIO()
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.redirect_stdout(silent),
        contextlib.redirect_stderr(silent),
    ):
        page = Path(folder) / "report.html"
        main([*COMMAND.split(), "--out", f"{folder}/results", "--report", str(page)])
        return page.read_text(encoding="utf-8")
