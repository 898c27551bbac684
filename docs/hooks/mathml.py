"""TeX becomes MathML while the site is built, so that a page shows formulas without JavaScript or the network."""

import html
import re
from typing import Any

from latex2mathml.converter import convert

_FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>([.,;:)]*)', re.DOTALL)
_TAG = re.compile(r"\\tag\{(\w+)\}")
_FUNCTION = re.compile(r"\\(sin|cos)(\^2)?(?![a-z])\s*")


def on_page_content(text: str, page: Any, **kwargs: Any) -> str:
    """Replace what Arithmatex has marked."""
    rendered = _FORMULA.sub(_render, text)
    page.present_anchor_ids |= set(re.findall(r'id="(eq-\w+)"', rendered))  # so that links to them are checked
    return rendered


def _render(formula: re.Match[str]) -> str:
    kind, tex = formula[1], html.unescape(formula[2]).strip()
    number = _TAG.search(tex)
    tex = _FUNCTION.sub(r"\\,\\\1\2\\,", _TAG.sub("", tex))  # the converter leaves no space around functions
    math = convert(tex, display="inline" if kind == "span" else "block")
    math = re.sub(r"<mover[^>]*>", '<mover accent="false">', math)  # browsers draw accents into letters with ascenders
    if kind == "span":  # a line must not begin with what follows a formula
        return f'<span class="formula">{math}{formula[3]}</span>' if formula[3] else math
    if number is None:
        return f'<div class="equation"><div>{math}</div></div>'
    anchor = f"eq-{number[1]}"
    return f'<div class="equation" id="{anchor}"><div>{math}</div><a href="#{anchor}">({number[1]})</a></div>'
