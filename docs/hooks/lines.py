"""Where a line may end: not between a number and what it counts, but inside a long name in a table."""

import re
from typing import Any

_CODE = re.compile(r"(<pre.*?</pre>|<code.*?</code>)", re.DOTALL)
_UNIT = re.compile(r"(?<=\d) (?=(?:%|[mnu]?s|m|N|rad|MB|of \d+)(?!\w))|(?<=Table) (?=\d)|(?<=\d,) (?=LQR|SMC)")
_TABLE = re.compile(r"<table>.*?</table>", re.DOTALL)
_JOINT = re.compile(r"(?<=[a-z])(?<!\btest)(?=_)|(?<=::)|(?<=[a-z]/)(?=\w)|(?<=[a-z]\.)(?!py|md|yaml)(?=[a-z])")


def on_page_content(text: str, **kwargs: Any) -> str:
    """Say so in a page."""
    parts = _CODE.split(text)
    parts[::2] = (_UNIT.sub("\N{NO-BREAK SPACE}", part) for part in parts[::2])
    return _TABLE.sub(lambda table: _CODE.sub(_breakable, table[0]), "".join(parts))


def _breakable(code: re.Match[str]) -> str:
    return re.sub(r"(?<=>)[^<]+", lambda name: _JOINT.sub("<wbr>", name[0]), code[0])
