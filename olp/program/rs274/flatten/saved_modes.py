"""M70 to M73 of LinuxCNC: modes that are saved, and restored by plain codes where they have changed.

Each level of subprograms has its own saved modes. M70 saves them, M71 drops them, M72 restores them. M73
saves them, and the end of the subprogram restores them. The motion code is none of them. Source: LinuxCNC's
manual on M70 to M73.
"""

from __future__ import annotations

from collections.abc import Sequence

from olp.core.errors import ProgramError
from olp.program.rs274.codes import COMPENSATION_OFF, CUTTER_COMPENSATION, GROUPS, LENGTHS, WORK_OFFSETS
from olp.program.rs274.flatten.state import ProgramState, Value
from olp.program.rs274.flatten.unit import Frame, Saved
from olp.program.rs274.flatten.written import number_text

#: M codes that save modes, drop and restore saved ones, and save them for one call.
SAVE = 70
DROP = 71
RESTORE = 72
SAVE_AND_RETURN = 73
_CODES = frozenset({SAVE, DROP, RESTORE, SAVE_AND_RETURN})
#: Further modes by what they are, and their G codes, ten times their number.
_MODES = {
    "the work offset": WORK_OFFSETS,
    "the tool length": LENGTHS | {490},
    "cutter compensation": CUTTER_COMPENSATION | {COMPENSATION_OFF},
    "the mode of the spindle": frozenset({960, 970}),
}
#: The same of M codes.
_M_MODES = {
    "the spindle": frozenset({3, 4, 5}), "coolant": frozenset({7, 8, 9}),
    "the override switches": frozenset({48, 49, 50, 51, 52, 53}),
}  # fmt: skip
#: Modes that one code restores.
_BY_CODE = frozenset({"the work offset", "the spindle"})


class SavedModes:
    """Follows the modes of a run, and says what restores saved ones."""

    def __init__(self, state: ProgramState) -> None:
        self._state = state
        self._further: dict[str, str] = {}

    def follow(self, words: Sequence[Value], *, switched: bool) -> None:
        """Take the words of a block; of one that may be left out what it states is not known."""
        codes = self._state.codes(words)
        for name, own in _MODES.items():
            stated = codes & own
            if stated:
                beside = "".join(f" {letter}{value}" for letter, value in words if letter in ("h", "d", "p"))
                self._further[name] = "?" if switched else f"G{next(iter(stated)) / 10:g}{beside}"
        for letter, value in words:
            for name, numbers in _M_MODES.items() if letter == "m" else ():
                if value in numbers:
                    self._further[name] = "?" if switched else f"M{value:g}"

    def takes(self, words: Sequence[Value]) -> bool:
        """Whether a block has one of these codes."""
        return self._state.profile.language.saved_modes and any(
            letter == "m" and value in _CODES for letter, value in words
        )

    def carry_out(self, words: Sequence[Value], frame: Frame, *, switched: bool) -> list[str]:
        """The blocks in the place of a block with one of these codes. Raises ProgramError for other words in
        it, for one that may be left out, and for what cannot be restored."""
        own = [word for word in words if word[0] != "n"]
        if len(own) != 1 or switched:
            raise ProgramError(
                "M70 to M73 beside other words or under block delete are not unrolled; give them a block of "
                "their own without `/`",
                code="OLP518",
            )
        code = own[0][1]
        if code == RESTORE:
            if frame.saved is None:
                raise ProgramError("M72 without saved modes; M70 must come before", code="OLP532")
            return self.restoring(frame.saved)
        frame.saved = None if code == DROP else self._now()
        frame.restores = code == SAVE_AND_RETURN
        return []

    def leaving(self, frame: Frame) -> list[str]:
        """The blocks at the end of a subprogram, which M73 asks for."""
        saved, frame.saved = frame.saved, None
        return self.restoring(saved) if frame.restores and saved is not None else []

    def _now(self) -> Saved:
        state = self._state
        groups = {group: getattr(state, group) for group in GROUPS}
        return Saved(state.unit, groups, state.path, dict(self._further), state.feed, state.speed)

    def restoring(self, saved: Saved) -> list[str]:
        """The blocks that put saved modes into force again."""
        state, now = self._state, self._now()
        codes = [*([saved.unit] if saved.unit != now.unit else [])]
        codes += [code for group, code in saved.groups.items() if code != now.groups[group]]
        if None in codes or -1 in codes:
            raise _not_stated("the unit or the return of cycles")
        texts = [" ".join(f"G{code / 10:g}" for code in codes if code is not None)]
        if saved.path != now.path:
            texts.append(saved.path)
        for name, word in now.further.items():
            before = saved.further.get(name)
            if before == word:
                continue
            if name not in _BY_CODE or before is None or before == "?" or " " in before:
                raise _not_stated(name)
            texts.append(before)
        for letter, value, present in (("F", saved.feed, now.feed), ("S", saved.speed, now.speed)):
            if value != present and value is not None:
                texts.append(letter + number_text(value, letter.lower(), state.profile.language))
        return [text for text in texts if text]


def _not_stated(what: str) -> ProgramError:
    return ProgramError(
        f"{what} is to be restored, and what it was is not known; state it before M70 or M73 saves it, or "
        "leave it as it is up to M72 or the end of the subprogram",
        code="OLP544",
    )
