"""A report as a piece of HTML, as notebooks show results."""

from __future__ import annotations

import html

#: Colour of the bar beside a report, by the answer of its verdict: good, bad, open or none.
_COLOURS = {True: "#1b7f4b", False: "#b3261e", None: "#8a949d"}


def fragment(text: str, ok: bool | None = None) -> str:
    """The text of a report with a bar in the colour of its verdict. All characters of the text are data."""
    style = (
        f"border-left: 4px solid {_COLOURS[ok]}; padding: 0.3em 0.8em; margin: 0; line-height: 1.35; "
        "overflow-x: auto; white-space: pre"
    )
    shown = "".join(c if c.isprintable() or c == "\n" else " " for c in text.rstrip("\n"))
    return f'<pre style="{style}">{html.escape(shown)}</pre>'
