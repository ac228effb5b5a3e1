"""Assignments of VAL 3: numbers that a program gives to its data."""

from __future__ import annotations

from olp.core.patterns import pattern
from olp.program.robots.line import Line
from olp.program.robots.val3.data import WORDS, Slot
from olp.program.robots.val3.state import Scope, State
from olp.program.robots.val3.values import Thing, words_of

_ASSIGNED = pattern(
    rb"(?s)([A-Za-z_]\w*(?::\w+)?)\s*(?:\[\s*([^\[\]]*?)\s*\])?\s*((?:\.\s*\w+\s*)*)([-+*/]?=)(?!=)\s*(.*)"
)
#: What motion descriptions call their speeds in programs, and in their data.
_SPEEDS = {"tvel": "tmax", "rvel": "rmax"}
_WORD = pattern(rb"[A-Za-z_]\w*")


def is_assignment(text: bytes) -> bool:
    return _ASSIGNED.fullmatch(text) is not None


def assign(state: State, line: Line, scope: Scope) -> None:
    """Give a datum its new value. What is not stated with numbers is not known behind it."""
    match = _ASSIGNED.fullmatch(line.text)
    assert match is not None
    name = match[1].decode("latin-1")
    place = line.begin + match.start(2)
    index = None if match[2] is None else state.data[place : place + len(match[2])]
    thing = state.named(name, index, place, scope)
    if thing is None:
        state.forget([name], f"an element of {name} is chosen in the run and gets another value", scope)
        return
    fields = tuple(part.strip().decode("latin-1").lower() for part in match[3].split(b".") if part.strip())
    if thing.kind not in _TAKES:
        return
    state.changed(thing)
    value = (-1, -1) if match[4] != b"=" else (line.begin + match.start(5), line.begin + match.end(5))
    if not _TAKES[thing.kind](state, thing, fields, value, scope):
        thing.why = f"it is computed in line {line.line}"
    if (why := state.beside.get(thing.name)) and state.things.get((thing.name, thing.key)) is thing:
        thing.why = why


def _given(thing: Thing, slots: list[Slot | None]) -> bool:
    """Give a datum all its numbers."""
    if len(slots) != len(thing.slots):
        return False
    thing.slots = dict(zip(thing.slots, slots, strict=True))
    thing.why = ""
    return True


def _one(thing: Thing, name: str, slot: Slot | None) -> bool:
    """Give a datum one of its numbers. Of one that is not known the others stay so."""
    if thing.why:
        thing.slots = dict.fromkeys(thing.slots)
        thing.words = dict.fromkeys(thing.words, "")
        thing.why = ""
    thing.slots[name] = slot
    return True


def _pose(state: State, thing: Thing, fields: tuple[str, ...], value: tuple[int, int], scope: Scope) -> bool:
    """A point, frame, tool or transform."""
    own = fields[1:] if fields[:1] == ("trsf",) else fields
    if fields[:1] == ("config",):
        return _configured(state, thing, fields[1:], value)
    if len(own) == 1 and own[0] in thing.slots:
        return _one(thing, own[0], state.number(value, scope) if value[0] >= 0 else None)
    if own:
        # what a tool opens and closes is no place
        return thing.kind == "tool"
    braces = None if value[0] < 0 else state.braces(value)
    if braces is not None:
        if braces.nested:
            thing.words.update(words_of(braces.words))
        return _given(thing, state.numbers(braces.parts, scope))
    slots = None if value[0] < 0 else state.transform(value, scope)
    if slots is None:
        return False
    other = None if fields else state.thing(value, scope)
    if other is not None and thing.kind == "point":
        if other.kind != "point" or other.father != thing.father:
            return False
        thing.words.update({word: other.words[word] for word in WORDS if word in other.words})
        thing.entry, thing.grows = other.entry, other.grows
    return _given(thing, list(slots))


def _configured(state: State, thing: Thing, fields: tuple[str, ...], value: tuple[int, int]) -> bool:
    """The words that name a posture."""
    text = state.data[slice(*value)].strip() if value[0] >= 0 else b""
    braces = state.braces(value) if value[0] >= 0 else None
    if not fields and braces is not None:
        words = [state.data[slice(*part)].decode("latin-1").lower() for part in braces.parts]
        thing.words.update(words_of(words))
        return len(words) == len(WORDS)
    if len(fields) == 1 and fields[0] in WORDS and _WORD.fullmatch(text):
        thing.words[fields[0]] = text.decode("latin-1").lower()
        return True
    return False


def _joint(state: State, thing: Thing, fields: tuple[str, ...], value: tuple[int, int], scope: Scope) -> bool:
    if len(fields) == 1 and fields[0] in thing.slots:
        return _one(thing, fields[0], state.number(value, scope) if value[0] >= 0 else None)
    braces = None if fields or value[0] < 0 else state.braces(value)
    if braces is not None:
        return _given(thing, state.numbers(braces.parts, scope))
    other = None if fields or value[0] < 0 else state.thing(value, scope)
    if other is None or other.kind != "joint" or other.why:
        return False
    return _given(thing, list(other.slots.values()))


def _motion(
    state: State, thing: Thing, fields: tuple[str, ...], value: tuple[int, int], scope: Scope
) -> bool:
    if len(fields) == 1:
        name = _SPEEDS.get(fields[0], fields[0])
        if name in thing.slots:
            _one(thing, name, state.number(value, scope) if value[0] >= 0 else None)
        else:
            thing.words[name] = state.data[slice(*value)].decode("latin-1").strip().lower()
        return True
    other = state.thing(value, scope) if not fields and value[0] >= 0 else None
    if other is None or other.kind != "mdesc" or other.why:
        return False
    thing.words.update(other.words)
    return _given(thing, list(other.slots.values()))


def _num(state: State, thing: Thing, fields: tuple[str, ...], value: tuple[int, int], scope: Scope) -> bool:
    thing.slots["value"] = state.number(value, scope) if value[0] >= 0 and not fields else None
    thing.why = ""
    return True


_TAKES = {
    "point": _pose, "frame": _pose, "tool": _pose, "trsf": _pose, "joint": _joint, "mdesc": _motion,
    "num": _num,
}  # fmt: skip
