"""A page from a template of ``assets/``, with style and scripts inside: a file that needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources
from typing import Any


def filled(name: str, scripts: Sequence[str], **values: Any) -> str:
    """A template with its values, which it escapes unless they are Markup."""
    import jinja2
    from markupsafe import Markup

    assets = resources.files(__package__) / "assets"
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("smo_gym.evaluation.report", "assets"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    text = environment.get_template(name).render(
        style=Markup((assets / "page.css").read_text(encoding="utf-8")),
        scripts=Markup("\n".join((assets / script).read_text(encoding="utf-8") for script in scripts)),
        **values,
    )
    return text.encode("utf-8", "replace").decode("utf-8")  # a path need not be text
