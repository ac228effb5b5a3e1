"""All dialects by name, which of them a text is written in, and the function that reads any of them.

A new dialect is a file with its value, `DIALECT`, and a line in `_KNOWN` here. One that a file describes is
that file and its name in `DESCRIBED`. Only this module looks names up. The file of a dialect is imported when
it is asked for: its name and its signs are known without.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from importlib import import_module

from olp.core.errors import ProgramError, UsageError
from olp.core.machine import Setup
from olp.core.patterns import pattern
from olp.core.spool import Text, in_parts, matches, whole
from olp.core.values import dataclass
from olp.program.bounds import bounded
from olp.program.dialect import Dialect
from olp.program.dialect import Options as Options
from olp.program.origin import in_original
from olp.program.program import Program
from olp.program.text import signs
from olp.program.text.signs import NO_SIGNS, Signs


@dataclass(frozen=True, slots=True)
class Known:
    """What is known of a dialect before its `module` is imported."""

    module: str
    signs: Signs = NO_SIGNS


_KNOWN = {
    "linuxcnc": Known("olp.program.rs274.profiles.linuxcnc"),
    "fanuc": Known("olp.program.rs274.profiles.fanuc"),
    "grbl": Known("olp.program.rs274.profiles.grbl"),
    "haas": Known("olp.program.rs274.profiles.haas"),
    "mach3": Known("olp.program.rs274.profiles.mach3"),
    "mach4": Known("olp.program.rs274.profiles.mach4"),
    "mazak": Known("olp.program.rs274.profiles.mazak"),
    "centroid": Known("olp.program.rs274.profiles.centroid"),
    "eding": Known("olp.program.rs274.profiles.eding"),
    "fagor": Known("olp.program.rs274.profiles.fagor"),
    "okuma": Known("olp.program.rs274.profiles.okuma", signs.OKUMA),
    "siemens-iso": Known("olp.program.rs274.profiles.siemens_iso"),
    "marlin": Known("olp.program.rs274.profiles.marlin", signs.PRINTER),
    "klipper": Known("olp.program.rs274.profiles.klipper", signs.KLIPPER),
    "sinumerik": Known("olp.program.sinumerik.dialect", signs.SINUMERIK),
    "heidenhain": Known("olp.program.heidenhain.dialect", signs.HEIDENHAIN),
    "apt": Known("olp.program.apt.dialect", signs.APT),
    "dmis": Known("olp.program.dmis.dialect", signs.DMIS),
    "list": Known("olp.program.pointlist.dialect", signs.LISTS),
    "fanuc-tp": Known("olp.program.robots.ls.dialect", signs.LS),
    "urscript": Known("olp.program.robots.urscript.dialect", signs.URSCRIPT),
    "abb-rapid": Known("olp.program.robots.rapid.dialect", signs.RAPID),
    "kuka-krl": Known("olp.program.robots.krl.dialect", signs.KRL),
    "yaskawa-inform": Known("olp.program.robots.inform.dialect", signs.INFORM),
    "staubli-val3": Known("olp.program.robots.val3.dialect", signs.VAL3),
}
#: Files of `olp/program/described/shipped` that describe a dialect, without their ending.
DESCRIBED = ("kawasaki-as", "val2", "karel")


_LOADED: dict[str, Dialect] = {}


class _Dialects(Mapping[str, Dialect]):
    """The dialects by name, each imported when it is first looked up."""

    def __getitem__(self, name: str) -> Dialect:
        if name not in _LOADED:
            known = _KNOWN[name]
            dialect: Dialect = import_module(known.module).DIALECT
            if (dialect.name, dialect.signs) != (name, known.signs):
                raise ValueError(f"the dialect {dialect.name} has another name or other signs than {name}")
            _LOADED[name] = dialect
        return _LOADED[name]

    def __iter__(self) -> Iterator[str]:
        return iter(_KNOWN)

    def __len__(self) -> int:
        return len(_KNOWN)

    def __contains__(self, name: object) -> bool:
        return name in _KNOWN


#: All registered dialects in the order of their lines.
DIALECTS: Mapping[str, Dialect] = _Dialects()

_VERSION = pattern(r"\.\d+$")
#: bytes of a text that are searched for signs of a dialect
_LOOKED_AT = 1 << 16
_PAYLOAD = pattern(rb"(?i)\bolp[ \t]+payload\b")


def read(
    data: Text, setup: Setup, dialect: Dialect, options: Options | None = None, *, words: bool = True
) -> Program:
    """Read a whole program. Raises ProgramError with the line of the first statement that cannot be read
    correctly; of an unrolled text with the line, and the file, that it was made from.

    Without `words` the columns that only writing needs are left out.
    """
    with in_original(data):
        if not dialect.payload_comments:
            _refuse_payloads(data, setup, dialect)
        text = data if dialect.long_texts else whole(data)
        program: Program = dialect.reader(text, setup, dialect, options or Options(), words=words)
        if text is not data and program.data is text:
            program = replace(program, data=data)
        return bounded(program)


def _refuse_payloads(data: Text, setup: Setup, dialect: Dialect) -> None:
    """Raises ProgramError where the payload changes inside a program whose language has no such comment."""
    what = (
        f"{dialect.title} programs have one payload; give payload_kg in the job file, and split the program"
    )
    if setup.job.payloads:
        raise ProgramError(
            f"[[payloads]] of the job file: {what}", line=min(setup.job.payloads), code="OLP550"
        )
    # a search of a text without the word takes 30 ns a byte
    stated = any(b"payload" in part.lower() for part in in_parts(data))
    comment = next(matches(_PAYLOAD, data), None) if stated else None
    if comment:
        raise ProgramError(
            f"a comment changes the payload: {what}",
            line=data.count(b"\n", 0, comment.start()) + 1,
            code="OLP550",
        )


def find(name: str) -> Dialect | None:
    """The registered dialect of this name, None where there is none."""
    return DIALECTS.get(name)


def named(name: str) -> Dialect:
    """The registered dialect of this name. Raises UsageError where there is none."""
    dialect = find(name)
    if dialect is None:
        import difflib

        near = difflib.get_close_matches(name.casefold(), DIALECTS, 1)
        hint = f"did you mean {near[0]}?" if near else f"expected one of {', '.join(DIALECTS)}"
        raise UsageError(f"there is no dialect {name!r}; {hint}")
    return dialect


def folder_endings() -> frozenset[str]:
    """The endings of files, in small letters, by which a folder shows its programs."""
    return frozenset(ending for dialect in DIALECTS.values() for ending in dialect.folder_endings)


def ending_of(file: str) -> str:
    """The ending of a file in small letters. That of a version (`.ncl.3`) does not count."""
    return _VERSION.sub("", file).rpartition(".")[2].lower()


def dialect_of(name: str | None, control: Dialect, data: Text, file: str) -> Dialect:
    """The dialect of a program: the one that is named, else what its text and the ending of its file show,
    else that of the control. An ending that programs of the control have too shows no other dialect. Raises
    UsageError for an unknown name, ProgramError where text and ending contradict each other or leave several
    dialects possible."""
    if name is not None:
        return named(name)
    names = _by_text(data)
    ending = _by_ending(file)
    if len(names) > 1 and ending in names:
        return DIALECTS[ending]
    if len(names) > 1 and control.name in names:
        return control
    if len(names) > 1:
        raise ProgramError(
            f"the text may be {' or '.join(sorted(names))}; name its dialect with --dialect, "
            "or with the key dialect of the job file",
            code="OLP503",
        )
    if names:
        (one,) = names
        if ending == control.name:
            # the machine file agrees, and languages of one family share statements
            return control
        if ending not in (None, one):
            raise ProgramError(
                f"the ending of the file is that of {ending}, and its text is {one}; name its dialect with "
                "--dialect, or with the key dialect of the job file",
                code="OLP503",
            )
        return DIALECTS[one]
    shared = ending_of(file) in control.folder_endings
    return control if ending is None or shared else DIALECTS[ending]


def _by_ending(file: str) -> str | None:
    """The dialect that alone has the ending of a file."""
    ending = ending_of(file)
    return next((name for name, known in _KNOWN.items() if ending in known.signs.endings), None)


def _by_text(data: Text) -> set[str]:
    """The dialects of statements that a text may be written in; none where it has no statements."""
    start = data[:_LOOKED_AT]
    if signs.is_plain(start):
        return set()
    start = b"\n".join(line for line in start.split(b"\n") if not signs.is_plain(line))
    own = ((name, known.signs.own) for name, known in _KNOWN.items())
    counts = {name: len(sign.findall(start)) for name, sign in own if sign is not None}
    most = max(counts.values(), default=0)
    if most:
        return {name for name, count in counts.items() if count == most}
    shared = ((name, known.signs.shared) for name, known in _KNOWN.items())
    return {name for name, sign in shared if sign is not None and sign.search(start)}
