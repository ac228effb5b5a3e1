"""Names of parameters whose values a job file may state."""

from __future__ import annotations

from olp.core.patterns import pattern

#: Numbered and named parameters of RS-274, those of Heidenhain, R-parameters, and variables of Okuma.
#: Then names of Sinumerik variables, with the index of an element: of three letters and more, or with `_` or
#: `$` in front, as shorter ones may be axes.
NAMES = pattern(
    r"#(\d{1,5}|<[^<>]+>)|Q[LR]?\d{1,5}|R\d{1,5}|VC\d{1,3}"
    r"|(?:\$[A-Z]|_|(?!AX\d)[A-Z][A-Z_]{2})[A-Z0-9_]*(?:\[\d+(?:,\d+)*\])?"
)
