"""A reader of cutter-location data and of DMIS motion that shares nothing with olp: text to canonical moves.

Written from the statement forms alone, for judging: what it does not know, it does not read (KeyError). One
regular expression a statement, no columns. Frames are given as (3, 3) rotation and (3,) origin by name.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .linuxcnc import ARC, FEED, RAPID, CanonMoves

NUMBER = r"[-+]?(?:\d+\.\d*|\.\d+|\d+)(?:[eEdD][-+]?\d+)?"
Frame = tuple[np.ndarray, np.ndarray]
AXIS_OF_PLANE = {2: 0, 0: 1, 1: 2}  # normal Z: XY, X: YZ, Y: ZX, as in `path.PLANE_AXES`
TEXT = ("PARTNO", "PPRINT", "INSERT", "REMARK", "TITLE")
QUIET = re.compile(
    r"(UNITS?|PARTNO|PPRINT|INSERT|REMARK|TITLE|SPINDL|COOLNT|CUTTER|SELECT|SETUP|TRNTYP|CSI_\w+|MACHIN|FEDRAT"
    r"|CUTCOM|PAINT|TOOL PATH|MULTAX|DELAY|STOP|OPSTOP|MSYS|CSYS|LOAD|LOADTL|CYCLE|INTOL|OUTTOL|END-OF-PATH"
    r"|SEQNO|DISPLY|FROM|SET/MODE|BOX|AUXFUN|PREFUN|CATPROCESS|TLAXIS|TPRINT|OPNAME|APPLY|DRESS|REWIND|OPSKIP"
    r"|ROTATE/\w+,ATANGL,0|STOCK|SELCTL|CLEARP|LEADER|MODE|TLDATA|INDEX|END)\b"
)


def at(frame: Frame, point: Sequence[float], unit: float, length: np.ndarray) -> np.ndarray:
    rotation, origin = frame
    return np.asarray(rotation @ (unit * np.array(point, float)) + origin + length)


def moved(frame: Frame, around: Sequence[Sequence[float]], lift: Sequence[float], unit: float) -> Frame:
    """The frame of points that a 3x4 matrix moves first, and a shift then."""
    rotation, origin = frame
    turn = np.array([row[:3] for row in around]) if around else np.eye(3)
    shift = np.array([row[3] for row in around]) if around else np.zeros(3)
    return rotation @ turn, origin + rotation @ (unit * (shift + np.array(lift)))


def numbers(text: str) -> list[float]:
    return [float(n.upper().replace("D", "E")) for n in re.findall(NUMBER, text)]


def joined(data: bytes) -> list[tuple[int, str]]:
    """(line, statement) with comments cut off and lines joined."""
    statements: list[tuple[int, str]] = []
    pending, first, comment = "", 0, False
    for number, raw in enumerate(data.decode("latin-1").replace("\r", "").split("\n"), 1):
        text = raw
        if comment or text.lstrip().startswith("$$"):
            comment = (comment or "$$->" in text[:8]) and text.rstrip().endswith("$")
            continue
        if not pending and text.strip().upper().startswith(TEXT):
            statements.append((number, text.strip().upper()))
            continue
        text = re.sub(r"\$\$.*", "", text)
        first = first if pending else number
        if text.rstrip().endswith("$"):
            pending += text.rstrip()[:-1]
            continue
        statements.append((first, (pending + text).strip().upper()))
        pending = ""
    return [(line, text) for line, text in statements if text]


@dataclass
class Moves:
    """Moves on their way."""

    line: list[int] = field(default_factory=list)
    kind: list[int] = field(default_factory=list)
    axis: list[np.ndarray] = field(default_factory=list)
    length: list[np.ndarray] = field(default_factory=list)
    tool: list[int] = field(default_factory=list)
    centre: list[np.ndarray] = field(default_factory=list)
    turns: list[int] = field(default_factory=list)
    plane: list[int] = field(default_factory=list)
    tool_vector: list[np.ndarray] = field(default_factory=list)

    def add(
        self, line: int, kind: int, axis: np.ndarray, length: np.ndarray, tool: int, tool_vector: np.ndarray,
        centre: np.ndarray | None = None, turns: int = 0, plane: int = 0,
    ) -> None:  # fmt: skip
        self.line.append(line)
        self.kind.append(kind)
        self.axis.append(axis)
        self.length.append(length)
        self.tool.append(tool)
        self.tool_vector.append(tool_vector)
        self.centre.append(np.zeros(3) if centre is None else centre)
        self.turns.append(turns)
        self.plane.append(plane)

    def canon(self) -> CanonMoves:
        bare = CanonMoves.polyline(np.vstack([self.axis[:1], *self.axis]), lines=np.array(self.line))
        return replace(
            bare, kind=np.array(self.kind), length=np.array(self.length), tool=np.array(self.tool),
            tip=np.array(self.axis) - np.array(self.length), centre=np.array(self.centre),
            turns=np.array(self.turns), plane=np.array(self.plane), start_known=False,
        )  # fmt: skip


def read_apt(
    data: bytes,
    frames: Mapping[str, Frame],
    tools: Mapping[int, float],
    *,
    tool: int = -1,
    first: str = "G54",
) -> Moves:
    """`tools`: lengths by number, which count once loaded; `tool`: in the spindle at the start, its length
    not active. The second coordinate system of the program is the frame CSYS2, and so on."""
    moves = Moves()
    unit, rapid, system, systems = 1.0, False, "", [""]
    here, length, aim = np.full(3, np.nan), np.zeros(3), np.array([0.0, 0.0, 1.0])
    tall = tools.get(tool, 0.0)
    arc: tuple[np.ndarray, np.ndarray, int] | None = None
    direction, size = None, 0.0
    around: list[Sequence[float]] = []
    lift: Sequence[float] = (0.0, 0.0, 0.0)
    for line, text in joined(data):
        major = text.partition("/")[0].strip()
        value = numbers(text.partition("/")[2]) if not text.startswith(TEXT) else []
        place = systems.index(system) + 1
        frame = moved(frames[first if place == 1 else f"CSYS{place}"], around, lift, unit)
        rotation = frame[0]
        if major == "RAPID":
            rapid = True
        elif major in ("GOTO", "GODLTA"):
            if len(value) == 6:
                aim = rotation @ np.array(value[3:])
            tool_vector = -tall * aim
            length = tall * aim if size else np.zeros(3)
            if major == "GOTO":
                here = at(frame, value[:3], unit, length)
            else:
                step = value if len(value) == 3 else [0.0, 0.0, value[0]]
                here = here + rotation @ (unit * np.array(step))
            if arc is not None:
                centre, normal, turns = arc
                k = int(np.abs(normal).argmax())
                sign = 1 if normal[k] > 0 else -1
                moves.add(
                    line,
                    ARC,
                    here,
                    length,
                    tool,
                    tool_vector,
                    centre + length,
                    sign * turns,
                    AXIS_OF_PLANE[k],
                )
            else:
                moves.add(line, RAPID if rapid else FEED, here, length, tool, tool_vector)
            rapid, arc = False, None
        elif major in ("CIRCLE", "MOVARC"):
            times = re.search(r"TIMES\s*,\s*(\d+)", text)
            # eleven numbers are those of NX, whose vector has arcs turn clockwise about it
            side = -1 if len(value) - bool(times) == 11 else 1
            arc = (at(frame, value[:3], unit, np.zeros(3)), rotation @ np.array(value[3:6]) * side,
                   int(times[1]) if times else 1)  # fmt: skip
        elif major == "INDIRV":
            direction = rotation @ np.array(value)
        elif major == "TLON,GOFWD":
            circle = numbers(re.search(r"\((?:CIRCLE|CYLNDR)/([^)]*)\)", text)[1])  # type: ignore[index]
            straight = numbers(re.search(r"\(LINE/([^)]*)\)", text)[1])  # type: ignore[index]
            normal = rotation @ np.array(circle[3:6] if len(circle) == 7 else (0.0, 0.0, 1.0))
            k = int(np.abs(normal).argmax())
            centre = at(frame, circle[:3], unit, length)
            turn = np.cross(here - centre, direction)[k]
            here = at(frame, straight[3:], unit, length)
            turns = 1 if turn > 0 else -1
            moves.add(line, ARC, here, length, tool, -tall * aim, centre, turns, AXIS_OF_PLANE[k])
        elif major in ("LOADTL", "LOAD"):
            tool, size = int(value[0]), 1.0
            tall = tools[tool]
        elif major == "TRACUT":
            around = [value[0:4], value[4:8], value[8:12]] if len(value) == 12 else []
            if not around and "NOMORE" not in text:
                raise KeyError(f"line {line}: {text}")
        elif major == "TRANS":
            lift = value
        elif major == "GOHOME":
            here = at(frame, value[:3], unit, length)
            moves.add(line, RAPID, here, length, tool, -tall * aim)
        elif major in ("UNITS", "UNIT"):
            unit = 25.4 if "INCH" in text else 1.0
        elif major in ("CSYS", "MSYS"):
            same = ([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0], [0, 0, 0, 1, 0, 0, 0, 1, 0])
            key = "" if value in same else repr(value)
            if not moves.line and key:
                systems[0] = key
            system = key
            if key not in systems:
                systems.append(key)
        elif major == "FINI":
            break
        elif not QUIET.match(text):
            raise KeyError(f"line {line}: {text}")
    return moves
