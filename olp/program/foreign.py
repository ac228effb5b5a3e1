"""Texts and files that are not read, recognised by name: languages of other controls, and other formats.

They are only looked for where a program has been refused, so that a program that can be read is never taken
for one of these.
"""

from __future__ import annotations

import re

from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.text.signs import SINUMERIK_LINE

#: Bytes of a text that are searched.
LOOKED_AT = 1 << 16

_OTHER_POST = "post-process the part for the control of the machine file, or give the CAM system's APT CLDATA"
_OSP = (
    "plain moves of it are read with --dialect okuma; else post-process for the control of the machine file"
)
_NAME_IT = "name its dialect with --dialect sinumerik, or with the key dialect of the job file"
_ROBOT = (
    "robots are not corrected from their own language; give a list of positions in the frame of the machine "
    "(CSV), or the CAM system's APT CLDATA"
)
_PROGRAM = "give the program that the CAM system writes for the control"
_TEXT = "save it as plain text (ASCII or UTF-8), and give that file"


@dataclass(frozen=True, slots=True)
class Foreign:
    """A language or format that is not read: `sign` matches what only its texts say, at least `least` times;
    `instead` is what to do. A `language` is not looked for in a text whose dialect is certain."""

    name: str
    sign: re.Pattern[bytes]
    instead: str
    least: int = 1
    code: str = "OLP501"
    language: bool = False
    #: what was made of it
    how: str = "which is not read"


def _line(pattern: bytes) -> re.Pattern[bytes]:
    """What begins a line, in capital or small letters."""
    return re.compile(rb"(?im)^[ \t]*(?:" + pattern + rb")")


FOREIGN = (
    Foreign("UTF-16 text", re.compile(rb"\A(?:\xff\xfe|\xfe\xff)"), _TEXT, code="OLP502"),
    Foreign(
        "a spreadsheet of Excel or LibreOffice",
        re.compile(rb"\APK\x03\x04(?s:.{0,4000}?)(?:xl/|content\.xml|opendocument)|\A\xd0\xcf\x11\xe0"),
        "save the sheet as CSV, and give that file",
        code="OLP502",
    ),
    Foreign(
        "a ZIP archive", re.compile(rb"\APK\x03\x04"), "unpack it, and give the program in it", code="OLP502"
    ),
    Foreign(
        "a gzip archive", re.compile(rb"\A\x1f\x8b"), "unpack it, and give the program in it", code="OLP502"
    ),
    Foreign("a PDF document", re.compile(rb"\A%PDF-"), _PROGRAM),
    Foreign("a picture", re.compile(rb"\A(?:\x89PNG|\xff\xd8\xff|GIF8|BM.{4}\0{4})"), _PROGRAM),
    Foreign("an STL mesh", re.compile(rb"(?i)\A\s*solid\b[^\r\n]*\r?\n\s*(?:facet|endsolid)"), _PROGRAM),
    Foreign(
        "STEP-NC (ISO 14649)",
        re.compile(rb"\A\s*ISO-10303-21;(?s:.{0,3000}?)(?:MACHINING|14649|AP238|WORKPLAN)"),
        _OTHER_POST,
    ),
    Foreign("a STEP model", re.compile(rb"\A\s*ISO-10303-21;"), _PROGRAM),
    Foreign("an IGES model", re.compile(rb"\A.{72}S      1"), _PROGRAM),
    Foreign("a DXF drawing", re.compile(rb"\A\s*(?:999\r?\n[^\r\n]*\r?\n\s*)?0\r?\nSECTION\r?\n"), _PROGRAM),
    Foreign("a web page or XML", re.compile(rb"(?i)\A\s*<(?:!doctype|html|\?xml)"), _PROGRAM),
    Foreign(
        "a file of olp in TOML",
        re.compile(
            rb"(?m)\A(?:[ \t]*(?:#[^\r\n]*)?\r?\n)*(?:\[[a-z_.]+\][ \t]*\r?$|"
            rb'[a-z_]+[ \t]*=[ \t]*["\[\d])'
        ),
        "give the program first, and the machine file with -m, the job file with -j",
    ),
    Foreign("JSON", re.compile(rb'\A\s*[{\[]\s*["{\[]'), _PROGRAM),
    Foreign(
        "KUKA KRL",
        _line(
            rb"&(?:ACCESS|REL|PARAM)\b|DEF(?:DAT|FCT)?[ \t]+[A-Z_]\w*[ \t]*\([^:\r\n]*\r?$|"
            rb"(?:PTP|LIN|CIRC)(?:_REL)?[ \t]+(?:\{|X[A-Z_]*\w*\b(?![ \t]*[-+.\d]))"
        ),
        _NAME_IT.replace("sinumerik", "kuka-krl"),
        language=True,
        how="and was read as another language",
    ),
    Foreign(
        "ABB RAPID",
        _line(
            rb"%%%\s*VERSION|MODULE[ \t]+\w+[ \t]*(?:\(|\r?$)|PROC[ \t]+\w+[ \t]*\(|"
            rb"Move(?:L|J|C|AbsJ)[ \t]+(?:\[|\w+[ \t]*,)|(?:CONST|PERS|VAR)[ \t]+(?:robtarget|tooldata)\b"
        ),
        _NAME_IT.replace("sinumerik", "abb-rapid"),
        language=True,
        how="and was read as another language",
    ),
    Foreign(
        "FANUC TP",
        _line(rb"/(?:PROG|ATTR|MN|POS)\b|\d*:[ \t]*[JLC][ \t]+PR?\["),
        _NAME_IT.replace("sinumerik", "fanuc-tp"),
        language=True,
        how="and was read as another language",
    ),
    Foreign(
        "Stäubli VAL 3",
        re.compile(rb"(?im)<Program[^>]*staubli|^[ \t]*begin[ \t]*\r?\n[ \t]*move[jlc]\("),
        _NAME_IT.replace("sinumerik", "staubli-val3"),
        language=True,
        how="and was read as another language",
    ),
    Foreign("Mazatrol", re.compile(rb"\AMAZATROL|\A\s*UNo\.[ \t]"), _OTHER_POST, language=True),
    Foreign(
        "UR script",
        _line(rb"def[ \t]+\w+\(\):|(?:movej|movel|movep|movec|servoj)[ \t]*\("),
        _NAME_IT.replace("sinumerik", "urscript"),
        language=True,
        how="and was read as another language",
    ),
    Foreign(
        "Yaskawa INFORM (JBI)",
        _line(rb"/JOB\b|//(?:NAME|POS|INST)\b|MOV[JLC][ \t]+C\d+"),
        _NAME_IT.replace("sinumerik", "yaskawa-inform"),
        language=True,
        how="and was read as another language",
    ),
    Foreign(
        "Sinumerik (Siemens)",
        _line(SINUMERIK_LINE + rb"|(?:N\d+[ \t]*)?(?:DEF|PROC)[ \t]+\w+"),
        _NAME_IT,
        language=True,
        how="and was read as another language",
    ),
    Foreign(
        "Okuma OSP",
        _line(rb"\$[\w-]+\.(?:MIN|SSB|SUB)\b|(?:N\d+[ \t]*)?(?:CALL[ \t]+O\w+|V[CT]\w+[ \t]*=)"),
        _OSP,
        language=True,
        how="and was read as another language",
    ),
    Foreign(
        "HPGL",
        re.compile(rb"(?i)\A\s*(?:\x1b[^;]*)?IN;|(?:;|\n|\A)(?:PU|PD|PA)[ \t]*-?\d+,-?\d+[^;]*;"),
        _PROGRAM,
        language=True,
    ),
)
#: A text has fewer of the bytes of binary files than one in so many: tapes begin with a few.
BINARY_SHARE = 50
#: Bytes that no text has.
_BINARY = re.compile(rb"[\x00-\x08\x0e-\x10\x15-\x19\x1c-\x1f]")


def recognised(data: bytes, *, languages: bool, own: frozenset[str] = frozenset()) -> ProgramError | None:
    """Why a text is no program that is read, by the name of what it is; None where it is not recognised.
    With `languages` those of other controls are looked for too. The `own` ones of its dialect are not."""
    start = data[:LOOKED_AT]
    for kind in FOREIGN:
        if kind.name in own or (kind.language and not languages):
            continue
        matches = [match for match, _ in zip(kind.sign.finditer(start), range(kind.least), strict=False)]
        if len(matches) == kind.least:
            line = _line_of(start, matches[0])
            return ProgramError(f"this is {kind.name}, {kind.how}; {kind.instead}", line=line, code=kind.code)
    binary = _BINARY.search(start)
    if binary is not None and len(_BINARY.findall(start)) * BINARY_SHARE > len(start):
        byte = start[binary.start()]
        what = f"the byte {byte:#04x} is in no text, so this is a binary file or one of another coding"
        return ProgramError(f"{what}; {_TEXT}", line=_line_of(start, binary), code="OLP502")
    return None


def _line_of(data: bytes, match: re.Match[bytes]) -> int:
    """The line of the first printed byte of a match."""
    text = match[0]
    return data.count(b"\n", 0, match.start() + len(text) - len(text.lstrip())) + 1
