"""Regular expressions that are compiled when they are first used.

Compiling takes up to a millisecond, and a run uses few of the patterns of the modules that it imports.
"""

from __future__ import annotations

import re
from typing import Any, AnyStr, cast

#: What a compiled pattern has.
_OWN = (
    *("search", "match", "fullmatch", "split", "findall", "finditer", "sub", "subn"),
    *("flags", "groups", "groupindex"),
)


class _Late:
    """Stands for a pattern. Once used, it has the methods of the compiled one, and costs nothing more."""

    def __init__(self, pattern: str | bytes, stated: int) -> None:
        self.pattern, self.stated = pattern, stated

    def __getattr__(self, name: str) -> Any:
        if name not in _OWN:
            raise AttributeError(f"a pattern has no attribute {name!r}")
        compiled = re.compile(self.pattern, self.stated)
        vars(self).update({own: getattr(compiled, own) for own in _OWN})
        return getattr(compiled, name)

    def __reduce__(self) -> Any:
        return _Late, (self.pattern, self.stated)

    def __repr__(self) -> str:
        return f"pattern({self.pattern!r}, {int(self.stated)})"


def pattern(text: AnyStr, flags: int = 0) -> re.Pattern[AnyStr]:
    """As `re.compile`; the pattern is compiled when it is first used."""
    return cast("re.Pattern[AnyStr]", _Late(text, flags))


#: Numbered and named parameters of RS-274, those of Heidenhain, R-parameters, and variables of Okuma.
#: Then names of Sinumerik variables, with the index of an element: of three letters and more, or with `_` or
#: `$` in front, as shorter ones may be axes.
PARAMETER_NAMES = pattern(
    r"#(\d{1,5}|<[^<>]+>)|Q[LR]?\d{1,5}|R\d{1,5}|VC\d{1,3}"
    r"|(?:\$[A-Z]|_|(?!AX\d)[A-Z][A-Z_]{2})[A-Z0-9_]*(?:\[\d+(?:,\d+)*\])?"
)
