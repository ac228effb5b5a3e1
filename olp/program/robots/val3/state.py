"""The data of an application while its programs are followed: which value each name has."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field

from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.robots.targets import Span
from olp.program.robots.val3.code import Routine
from olp.program.robots.val3.data import KINDS, NUMBERS, Datum, Slot
from olp.program.robots.val3.values import REFERENCE, Aggregate, Thing, aggregate, arguments, literal


@dataclass(slots=True, eq=False)
class Scope:
    """What the names of a running program mean: its own data, and data of its caller by another name."""

    routine: Routine
    own: dict[str, Thing] = field(default_factory=dict)
    alias: dict[str, tuple[str, str]] = field(default_factory=dict)


class State:
    """The values of all data. `elsewhere` are names that programs give other values that are not followed,
    and where, `beside` those that other tasks may change at any time. `through` are the names by which
    numbers were taken, by the bytes of these: each with its program, empty for data of the application."""

    def __init__(
        self, data: bytes, declared: Iterable[Datum], elsewhere: dict[str, str], beside: dict[str, str]
    ) -> None:  # fmt: skip
        self.data, self.elsewhere, self.beside = data, elsewhere | beside, beside
        self.declared: dict[str, Datum] = {}
        for datum in declared:
            if datum.name in self.declared:
                raise ProgramError(f"{datum.name} is declared twice", line=datum.line, code="OLP533")
            self.declared[datum.name] = datum
        self.things: dict[tuple[str, str], Thing] = {}
        self.versions = 0
        self.through: dict[Span, set[tuple[str, str]]] = {}

    # -- names ---------------------------------------------------------------------------------------

    def thing(self, span: Span, scope: Scope) -> Thing | None:
        """The datum that a name with its index is; None where it is none, or the index is not known."""
        match = REFERENCE.fullmatch(self.data, *span)
        if match is None or match[3]:
            return None
        return self.named(match[1].decode("latin-1"), match[2], match.start(2), scope)

    def knows(self, name: str, scope: Scope) -> bool:
        """Whether a name is declared."""
        return (
            name in self.declared or name in scope.own or name in scope.alias or name in scope.routine.locals
        )

    def named(self, name: str, index: bytes | None, place: int, scope: Scope) -> Thing | None:
        key = "0" if index is None else self._key(index, place, scope)
        if key is None:
            return None
        if name in scope.own:
            return scope.own[name] if key == "0" else None
        if name in scope.alias:
            name, own = scope.alias[name]
            key = own if key == "0" else key
        elif name in scope.routine.locals:
            kind = KINDS.get(scope.routine.locals[name], scope.routine.locals[name])
            return scope.own.setdefault(name, Thing.empty(kind, name, key)) if key == "0" else None
        return self.of(name, key)

    def of(self, name: str, key: str) -> Thing | None:
        """A datum of the application."""
        if (name, key) not in self.things:
            datum = self.declared.get(name)
            if datum is None:
                return None
            thing = Thing.empty(datum.kind, name, key)
            entry = datum.entries.get(key)
            if entry is not None:
                thing.slots, thing.words, thing.father = dict(entry.slots), dict(entry.words), entry.father
                thing.entry, thing.grows = entry, datum.grows
            thing.why = self.elsewhere.get(name, "")
            self.things[name, key] = thing
        return self.things[name, key]

    def _key(self, index: bytes, place: int, scope: Scope) -> str | None:
        text = index.strip()
        if text[:1] == b'"':
            return text.strip(b'"').decode("latin-1")
        slot = self.number((place, place + len(index)), scope)
        if slot is None or slot[1] != int(slot[1]):
            return None
        return str(int(slot[1]))

    # -- values --------------------------------------------------------------------------------------

    def number(self, span: Span, scope: Scope) -> Slot | None:
        """The number that an expression is: as it stands, or that of a name."""
        text = self.data[slice(*span)]
        blank = len(text) - len(text.lstrip())
        found = literal(text.strip(), span[0] + blank)
        if found is not None:
            return found
        match = REFERENCE.fullmatch(text.strip())
        if match is None:
            return None
        thing = self.named(
            match[1].decode("latin-1"), match[2], span[0] + blank + max(match.start(2), 0), scope
        )
        if thing is None or thing.why:
            return None
        fields = [part.strip().decode("latin-1").lower() for part in match[3].split(b".") if part.strip()]
        if not fields and thing.kind == "num":
            fields, slot = ["value"], thing.slots["value"]
            if slot is not None:
                name = match[1].decode("latin-1")
                own = scope.routine.name if scope.routine.has(name) else ""
                self.through.setdefault(slot[0], set()).add((own, name))
        return thing.slots.get(fields[-1]) if fields else None

    def numbers(self, parts: Iterable[Span], scope: Scope) -> list[Slot | None]:
        return [self.number(part, scope) for part in parts]

    def transform(self, span: Span, scope: Scope) -> list[Slot] | None:
        """The six numbers of a transform: in braces, or those of a name."""
        own = self.braces(span)
        found: list[Slot | None] | None = None
        if own is not None and not own.nested:
            found = self.numbers(own.parts, scope)
        else:
            match = REFERENCE.fullmatch(self.data, *span)
            fields = b"" if match is None else b"".join(match[3].split()).lower()
            if match is not None and fields in (b"", b".trsf"):
                thing = self.named(match[1].decode("latin-1"), match[2], match.start(2), scope)
                if thing is not None and not thing.why and thing.kind not in ("joint", "num", "mdesc"):
                    found = list(thing.slots.values())
        if found is None or len(found) != len(NUMBERS["trsf"]):
            return None
        known = [slot for slot in found if slot is not None]
        return known if len(known) == len(found) else None

    def braces(self, span: Span) -> Aggregate | None:
        return aggregate(self.data[slice(*span)], span[0])

    def arguments(self, begin: int, end: int) -> list[Span]:
        return arguments(self.data[begin:end], begin)

    # -- changes -------------------------------------------------------------------------------------

    def changed(self, thing: Thing) -> None:
        """A value was given to a datum."""
        self.versions += 1
        thing.version = self.versions

    def forget(self, names: Iterable[str], why: str, scope: Scope) -> None:
        """Nothing is known of data any more. `why` says it."""
        for name in names:
            own = scope.alias.get(name, (name, "0"))[0]
            if name in scope.own:
                scope.own[name].why = why
            for key in [*(k for n, k in self.things if n == own), *self._keys(own)]:
                thing = self.of(own, key)
                assert thing is not None
                thing.why = why
                self.changed(thing)

    def _keys(self, name: str) -> list[str]:
        datum = self.declared.get(name)
        return [] if datum is None else list(datum.entries)

    def saved(self, names: Iterable[str], scope: Scope) -> list[tuple[Thing, Thing]]:
        """The values of data, to be put back."""
        found = []
        for name in names:
            own = scope.alias.get(name, (name, "0"))[0]
            things = [thing for (n, _), thing in self.things.items() if n == own]
            things += [self.of(own, key) for key in self._keys(own)]  # type: ignore[misc]
            if name in scope.own:
                things.append(scope.own[name])
            found += [(thing, thing.copy()) for thing in dict.fromkeys(things)]
        return found

    def put_back(self, saved: Iterable[tuple[Thing, Thing]]) -> None:
        for thing, before in saved:
            thing.slots, thing.words = dict(before.slots), dict(before.words)
            thing.father, thing.why, thing.version = before.father, before.why, before.version
