"""How the tool turns on straight moves of a KRL text: evenly, unless `$ORI_TYPE` says otherwise."""

from __future__ import annotations

from collections.abc import Sequence

from olp.core.patterns import pattern
from olp.program.robots.krl.text import Line
from olp.program.robots.moves import not_read

_SET = pattern(rb"(?i)\$ORI_TYPE\s*=(?!=)\s*(.*)")
_WITH = pattern(rb"(?i)\$ORI_TYPE\s*=\s*(SORI_TYP\s*\([^()]*\)|[^,]*)")
_OF_TAUGHT = pattern(rb"(?i)SORI_TYP\s*\(\s*(\w+)\s*\)\s*")
_TAUGHT = pattern(rb"(?i)(\w+)\s*=\s*\{[^{}]*\bORI_TYP\s*#(\w+)")
_ACTIVE = pattern(rb"(?i)LDAT_ACT\s*=\s*(\w+)")
_BAS = pattern(rb"(?i)BAS\s*\(\s*#(INITMOV|CP_PARAMS)\b")
_EVEN = "#VAR"
#: Arcs along which the tool turns with the path.
_ALONG = pattern(rb"(?i)\$CIRC_TYPE\s*=(?!=)\s*(?!#BASE\b|SCIRC_TYP)|\bCIRC_TYP\s+#(?!BASE\b)")


class Turning:
    """Follows the statements that say how tools turn. Where it depends on the run, what the text sets
    anywhere may be in force."""

    def __init__(self, lines: Sequence[Line]) -> None:
        self._taught: dict[bytes, str] = {}
        for line in lines:
            # most lines are positions and moves
            taught = _TAUGHT.search(line.text) if b"#" in line.text else None
            if taught is not None:
                self._taught[taught[1].upper()] = "#" + taught[2].decode("latin-1").upper()
        self._active = _EVEN
        #: what is set, and its line; None where tools turn evenly
        self._now: tuple[str, int] | None = None
        self._any: tuple[str, int] | None = None
        for line in lines:
            self.take(line)
            self._any = self._any or self._now
        self._now, self._begun = None, False
        #: the first line that lets tools turn along with arcs, 0 for none
        self._along = next((n.line for n in lines if b"#" in n.text and _ALONG.search(n.text)), 0)

    def forget(self) -> None:
        """What is in force depends on the run from here on. Before the first statement tools turn evenly."""
        if self._begun:
            self._now = self._any

    def take(self, line: Line) -> None:
        """Follow a statement."""
        self._begun = True
        # most lines are positions and moves
        if line.text[:1] != b"$" and line.word not in (b"BAS", b"LDAT_ACT"):
            return
        stated, active, call = (form.match(line.text) for form in (_SET, _ACTIVE, _BAS))
        if stated is not None:
            self._put(self._value(stated[1]), line)
        elif active is not None:
            self._active = self._taught.get(active[1].upper(), _EVEN)
        elif call is not None:
            self._put(_EVEN if call[1].upper() == b"INITMOV" else self._active, line)

    def check_arc(self, line: Line) -> None:
        """Raises ProgramError for an arc along which the tool may turn with the path."""
        if self._along:
            raise not_read(
                f"the tool may turn along with this arc ($CIRC_TYPE or CIRC_TYP in line {self._along}), "
                "which is not read; set #BASE",
                line.line,
            )

    def _put(self, value: str, line: Line) -> None:
        self._now = None if value == _EVEN else (value, line.line)

    def _value(self, text: bytes) -> str:
        of_taught = _OF_TAUGHT.fullmatch(text)
        if of_taught is not None:
            return self._taught.get(of_taught[1].upper(), _EVEN)
        return text.strip().decode("latin-1").upper()

    def check(self, words: bytes, line: Line) -> None:
        """Raises ProgramError for a straight move with `words` behind WITH on which the tool does not turn
        evenly."""
        own = _WITH.search(words)
        found = self._now
        if own is not None:
            value = self._value(own[1])
            found = None if value == _EVEN else (value, line.line)
        if found is not None:
            raise not_read(
                f"the tool may not turn evenly on this move ($ORI_TYPE={found[0]} in line {found[1]}), which "
                f"is not read on arms; set $ORI_TYPE={_EVEN} before it",
                line.line,
            )
