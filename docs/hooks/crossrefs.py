"""The docstrings' roles (:class:`name` and its like) as links of the site."""

import re
from typing import Any

import griffe

_PAGE = "\n## Description\n"
"""Where a docstring in Gymnasium's form goes on with what the environment's own page has, all but its errors."""
_ROLE = re.compile(r":(?:class|func|meth|data|mod|attr):`(~?)([\w.]+)`")


def linked(text: str, scope: griffe.Object) -> str:
    """A docstring with its roles as Markdown cross-references, and its literal blocks as Markdown's."""
    text, rest = text.partition(_PAGE)[::2]
    if rest:
        text += "\n[Its page](../environments/pendulum.md) says more.\n" + "".join(rest.partition("\nRaises:")[1:])

    def link(role: re.Match[str]) -> str:
        short, name = role.groups()
        if name.startswith("."):  # of the same package
            name = scope.module.path.rpartition(".")[0] + name
        shown = f"`{name.rpartition('.')[2] if short else name}`"
        try:
            target = name if name.startswith("smo_gym.") else scope.resolve(name)
        except griffe.NameResolutionError:  # inherited from another package
            return shown
        # what has no docstring has no entry to point to
        return f"[{shown}][{target}]" if scope.modules_collection[target].has_docstring else shown

    return re.sub(r"^::\n", "", _ROLE.sub(link, text), flags=re.MULTILINE)


class Crossrefs(griffe.Extension):
    """Rewrites every docstring as it is loaded."""

    def on_package(self, *, pkg: griffe.Module, **kwargs: Any) -> None:
        """Rewrite the package's, when all its names are known."""
        self._rewrite(pkg)

    def _rewrite(self, obj: griffe.Object) -> None:
        if obj.docstring:
            obj.docstring.value = linked(obj.docstring.value, obj)
        for member in obj.members.values():
            if not member.is_alias:
                self._rewrite(member)  # type: ignore[arg-type]
