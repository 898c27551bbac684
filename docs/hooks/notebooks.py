"""The notebooks as pages, with the outputs that they are committed with."""

from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from nbconvert import MarkdownExporter

NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"
_TEMPLATE = """{% extends 'markdown/index.md.j2' %}
{% block data_png %}
![{{ cell.metadata.alt }}]({{ output.metadata.filenames['image/png'] | path2url }})
{% endblock %}"""


def on_files(files: Files, config: MkDocsConfig, **kwargs: Any) -> Files:
    """Add a page and its pictures for every notebook."""
    exporter = MarkdownExporter(raw_template=_TEMPLATE)
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        text, resources = exporter.from_filename(str(path), {"unique_key": path.stem})
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content=text))
        for name, picture in resources["outputs"].items():
            files.append(File.generated(config, f"notebooks/{name}", content=picture))
    return files
