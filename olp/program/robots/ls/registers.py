"""What a TP program says of its position registers, frames and tools, while it is read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from olp.core.patterns import pattern
from olp.program.robots.poses import Pose, of_zyx

_INDEX = rb"\[\s*(\d+)\s*(?::[^\],]*)?\]"
_ELEMENT = pattern(
    rb"(?i)\s*PR\[\s*(\d+)\s*,\s*(\d+)\s*(?::[^\]]*)?\]\s*=\s*\(?\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*\)?\s*"
)
_WHOLE = pattern(rb"(?i)\s*PR(?:" + _INDEX + rb"|\[\s*(\d+)\s*,[^\]]*\])\s*=.*")
_ACTIVE = pattern(rb"(?i)\s*(UFRAME|UTOOL|WKZ|BENUTZER)_NUM\s*=\s*(.*?)\s*")
_STATED = pattern(rb"(?i)\s*(UFRAME|UTOOL)" + _INDEX + rb"\s*=\s*(?:PR" + _INDEX + rb"|.*)\s*")
#: One whose number a register holds, or a variable of the control for it.
_CHOSEN = pattern(rb"(?i)\s*(?:\$MNUFRAME|\$MNUTOOL|(?:UFRAME|UTOOL)\s*\[\s*[A-Z]+\s*\[)[^=]*=.*")
#: Statements behind which others may not run, or run again.
_PARTS = pattern(rb"(?i)\b(?:JMP|IF|FOR|SELECT|LBL)\b")


class Registers:
    """Registers with all numbers that the text gives them so far. Behind a label or a call nothing is known
    of them any more. Frames and tools that one of the `texts` of statements sets are those that it states, or
    are not known."""

    def __init__(self, texts: Iterable[bytes]) -> None:
        self._numbers: dict[int, dict[int, float]] = {}
        self._stated: dict[tuple[bytes, int], Pose | None] = {}
        self._times: Counter[tuple[bytes, int]] = Counter()
        #: whether the run chooses which of them gets other numbers, and whether all so far runs once
        self._chosen, self._sure = False, True
        self.frame = self.tool = -1
        for text in texts:
            stated = _STATED.fullmatch(text)
            if stated is not None:
                self._times[stated[1].upper(), int(stated[2])] += 1
            self._chosen |= _CHOSEN.fullmatch(text) is not None

    def frame_of(self, number: int) -> tuple[bool, Pose | None]:
        """Whether the program sets a frame by its number, and its pose; None where that is not known."""
        return self._set(b"UFRAME", number)

    def tool_of(self, number: int) -> tuple[bool, Pose | None]:
        """The same of a tool."""
        return self._set(b"UTOOL", number)

    def _set(self, table: bytes, number: int) -> tuple[bool, Pose | None]:
        key = table, number
        return self._chosen or key in self._times, None if self._chosen else self._stated.get(key)

    def forget(self) -> None:
        """What a register holds depends on the run from here on."""
        self._numbers = {}
        self.frame = self.tool = -1

    def pose(self, number: int) -> Pose | None:
        """The pose that a register holds; None where the text does not say all of it."""
        own = self._numbers.get(number, {})
        if not all(k in own for k in range(1, 7)):
            return None
        return Pose((own[1], own[2], own[3]), of_zyx((own[6], own[5], own[4])))

    def take(self, text: bytes) -> bool:
        """Whether a statement is about a register, a frame or a tool; it is followed."""
        self._sure &= _PARTS.search(text) is None
        element = _ELEMENT.fullmatch(text)
        if element is not None:
            own = self._numbers.setdefault(int(element[1]), {})
            own[int(element[2])] = float(element[3])
            return True
        whole = _WHOLE.fullmatch(text)
        if whole is not None:
            self._numbers.pop(int(whole[1] or whole[2]), None)
            return True
        active = _ACTIVE.fullmatch(text)
        if active is not None:
            number = int(active[2]) if active[2].isdigit() else -1
            if active[1].upper() in (b"UFRAME", b"BENUTZER"):
                self.frame = number
            else:
                self.tool = number
            return True
        stated = _STATED.fullmatch(text)
        if stated is None:
            return False
        key = stated[1].upper(), int(stated[2])
        certain = self._sure and self._times[key] == 1 and stated[3] is not None
        self._stated[key] = self.pose(int(stated[3])) if certain else None
        return True
