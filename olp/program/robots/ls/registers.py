"""What a TP program says of its position registers, frames and tools, while it is read."""

from __future__ import annotations

from olp.core.patterns import pattern
from olp.program.robots.poses import Pose, of_zyx

_INDEX = rb"\[\s*(\d+)\s*(?::[^\],]*)?\]"
_ELEMENT = pattern(
    rb"(?i)\s*PR\[\s*(\d+)\s*,\s*(\d+)\s*(?::[^\]]*)?\]\s*=\s*\(?\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*\)?\s*"
)
_WHOLE = pattern(rb"(?i)\s*PR(?:" + _INDEX + rb"|\[\s*(\d+)\s*,[^\]]*\])\s*=.*")
_ACTIVE = pattern(rb"(?i)\s*(UFRAME|UTOOL|WKZ|BENUTZER)_NUM\s*=\s*(.*?)\s*")
_STATED = pattern(rb"(?i)\s*(UFRAME|UTOOL)" + _INDEX + rb"\s*=\s*(?:PR" + _INDEX + rb"|.*)\s*")


class Registers:
    """Registers with all numbers that the text gives them so far. Behind a label or a call nothing is known
    of them any more. `frames` and `tools` are those that the program states."""

    def __init__(self) -> None:
        self._numbers: dict[int, dict[int, float]] = {}
        self.frames: dict[int, Pose | None] = {}
        self.tools: dict[int, Pose | None] = {}
        self.frame = self.tool = -1

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
        table = self.frames if stated[1].upper() == b"UFRAME" else self.tools
        table[int(stated[2])] = None if stated[3] is None else self.pose(int(stated[3]))
        return True
