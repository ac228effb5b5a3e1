"""The modules of a program of RAPID that belong together, in one folder.

A module needs another one that declares what it uses and does not declare itself: targets, tools, work
objects, speeds. Whoever uses a declared target belongs to it as well, since a correction changes it; so does
whoever gives another value to what is needed. A `.pgf` that names modules says that these are one program.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from olp.core.patterns import pattern
from olp.core.projects import Beside, is_plain
from olp.core.values import dataclass

#: Endings of modules, and of the file that names those of a program.
_MODULES = (".mod", ".modx", ".prg", ".sys", ".sysx")
_PROGRAM = ".pgf"
_NAMED = pattern(rb"(?i)<module>\s*([^<>]*?)\s*</module>")
_ASIDE = pattern(rb"\"[^\"\r\n]*\"|![^\r\n]*")
_ROUTINE = pattern(rb"(?im)^[ \t]*(?:LOCAL[ \t]+)?(?:PROC|FUNC|TRAP)\b")
_DECLARED = pattern(
    rb"(?i)(?<!\w)(?:(LOCAL|TASK)\s+)?(?:CONST|PERS|VAR)\s+(robtarget|jointtarget|tooldata|wobjdata|speeddata)"
    rb"\s+(\w+)"
)
_WORD = pattern(rb"[A-Za-z]\w*")
#: A name that gets a value.
_INDEX = rb"(?:\s*\{(?:[^{}]|\{[^{}]*\})*\})?"
GIVEN = pattern(rb"(?<![\\\w.}])([A-Za-z]\w*)" + _INDEX + rb"(?:\s*\.\s*\w+" + _INDEX + rb")*\s*:=")
_TARGETS = frozenset((b"ROBTARGET", b"JOINTTARGET"))


@dataclass(frozen=True, slots=True)
class _Module:
    """What a module has of others, by names in capitals. `offered` are the types of what it declares for
    others. `wanted` are the words of its text that it does not declare, and `given` those of them that get
    another value there."""

    offered: Mapping[bytes, bytes]
    wanted: frozenset[bytes]
    given: frozenset[bytes]


def files_of(path: Path, beside: Beside) -> list[Path]:
    """The modules that belong to a module, or to those that a `.pgf` names; the file itself first. Raises
    InputError where one cannot be read."""
    listed = (file for ending in _MODULES for file in beside.listed(path.parent, ending))
    every = [path.with_name(file.name) for file in listed]
    own = _own(path, beside)
    if set(every) <= {path} and own == [path]:
        return [path]
    modules = {file: _module(beside.read(file)) for file in dict.fromkeys((*own, *every)) if file != path}
    modules[path] = _module(beside.read(path))
    found = dict.fromkeys((path, *own))
    while True:
        more = [file for file in modules if file not in found and _belongs(file, found, modules)]
        if not more:
            return list(found)
        found |= dict.fromkeys(more)


def _own(path: Path, beside: Beside) -> list[Path]:
    """The file, with the modules of the `.pgf` that it is, or that alone names it."""
    if path.suffix.lower() == _PROGRAM:
        return [path, *_modules_of(path, beside)]
    listed = (path.with_name(file.name) for file in beside.listed(path.parent, _PROGRAM))
    naming = [names for names in (_modules_of(file, beside) for file in listed) if path in names]
    return [path, *(naming[0] if len(naming) == 1 else ())]


def _modules_of(program: Path, beside: Beside) -> list[Path]:
    """The modules that a `.pgf` names and that are beside it."""
    names = (name.decode("utf-8", "replace") for name in _NAMED.findall(beside.read(program)))
    return [program.with_name(n) for n in names if is_plain(n) and beside.exists(program.with_name(n))]


def _module(data: bytes) -> _Module:
    text = _ASIDE.sub(b" ", data)
    first = _ROUTINE.search(text)
    declared = [
        match.groups() for match in _DECLARED.finditer(text, 0, first.start() if first else len(text))
    ]
    own = {name.upper() for _, _, name in declared}
    offered = {
        name.upper(): type_.upper() for local, type_, name in declared if (local or b"").upper() != b"LOCAL"
    }
    words = frozenset(word.upper() for word in set(_WORD.findall(text)))
    given = frozenset(word.upper() for word in set(GIVEN.findall(text)))
    return _Module(offered, words - own, given - own)


def _belongs(file: Path, found: Iterable[Path], modules: Mapping[Path, _Module]) -> bool:
    """Whether a module has to be read with others."""
    new = modules[file]
    for other in found:
        known = modules[other]
        needed = new.offered.keys() & known.wanted
        used = new.wanted & {name for name, type_ in known.offered.items() if type_ in _TARGETS}
        changed = new.given & known.offered.keys()
        if needed or used or changed:
            return True
    return False
