"""Drawings become part of their page, so that their colours follow the reader's choice of light or dark."""

import re
from pathlib import Path
from typing import Any

IMAGES = Path(__file__).resolve().parents[1] / "images"
_DRAWING = re.compile(r'<img alt="([^"]+)" src="[./]*images/(\w+\.svg)" ?/?>')


def on_page_content(text: str, **kwargs: Any) -> str:
    """Put the drawings into a page."""
    return _DRAWING.sub(_inlined, text)


def _inlined(image: re.Match[str]) -> str:
    alt, name = image.groups()
    drawing = (IMAGES / name).read_text(encoding="utf-8")
    return drawing.replace("<svg ", f'<svg role="img" aria-label="{alt}" ', 1)
