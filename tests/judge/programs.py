"""Random but legal G-code in LinuxCNC's dialect: every way of writing that a corrector has to keep.

All points stay within a range of work coordinates given in mm. The writer keeps its own exact position in
output digits, so incremental sections and omitted words never leave the range.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

FEATURES = (
    "lines", "short", "rapid", "arcs", "planes", "helix", "circle", "radius", "incremental", "frames",
    "cycles", "g92", "g52", "g10", "tools", "modal", "style", "comments", "numbers", "dwell",
)  # fmt: skip
#: Sections after which a cut begins where the tool was left uncorrected, or with an unknown play.
LOOSE = ("blind", "machine", "home", "off", "deleted", "series", "joint")
RANGE = ((-60.0, 60.0), (-50.0, 50.0), (-20.0, 40.0))


@dataclass
class _Writer:
    rng: np.random.Generator
    scale: float  # mm per program unit
    digits: int
    style: bool
    numbers: bool
    modal: bool
    blocks: list[str] = field(default_factory=list)
    position: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # program units, as written
    offset: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # G92 or G52 in force
    motion: str = ""
    relative: bool = False
    number: int = 10

    def round(self, mm: float) -> float:
        return round(mm / self.scale, self.digits)

    def value(self, value: float) -> str:
        text = f"{value:.{self.digits}f}"
        if text.lstrip("-0.") == "":
            text = text.lstrip("-")
        if not self.style:
            return text
        if self.rng.random() < 0.4 and "." in text:
            text = text.rstrip("0")
        if self.rng.random() < 0.2 and text.startswith(("0.", "-0.")) and len(text) > 3:
            text = text.replace("0.", ".", 1)
        if self.rng.random() < 0.1 and not text.startswith("-"):
            text = "+" + text
        if self.rng.random() < 0.3 and text.endswith("."):
            text = text[:-1]
        return text

    def line(self, *words: str, comment: str = "") -> None:
        parts = [word for word in words if word]
        if self.numbers and self.rng.random() < 0.8:
            parts.insert(0, f"N{self.number}")
            self.number += 10
        if self.style:
            parts = [part.lower() if self.rng.random() < 0.2 else part for part in parts]
            gap = ["", " ", "  ", "\t"][self.rng.choice(4, p=[0.25, 0.6, 0.1, 0.05])]
        else:
            gap = " "
        self.blocks.append(gap.join(parts) + comment)

    def go(self, code: str, target: list[float], *extra: str) -> None:
        """One motion block to a target in program units (absolute, without the running offset)."""
        words = []
        for i, letter in enumerate("XYZ"):
            step = round(target[i] - self.position[i], self.digits)
            if step == 0.0 and (self.modal and self.rng.random() < 0.9):
                continue
            number = step if self.relative else round(target[i] - self.offset[i], self.digits)
            words.append(letter + self.value(number))
        if not words and not extra:
            return
        shown = "" if self.modal and code == self.motion else code
        if self.style and self.rng.random() < 0.1 and not shown:
            shown = code
        if self.style and shown and self.rng.random() < 0.3:
            shown = shown.replace("G", "G0")
        self.line(shown, *words, *extra)
        self.motion = code
        self.position = list(target)


def random_program(
    seed: int,
    *,
    features: Collection[str] = FEATURES,
    range_mm: tuple[tuple[float, float], ...] = RANGE,
    blocks: int = 25,
    inch: bool | None = None,
    digits: int | None = None,
    g55_mm: tuple[float, float, float] = (425.0, 305.0, -275.0),
) -> bytes:
    """A legal program with `blocks` random sections of the named features; G54 (and G55), tools 1 and 2.

    "g10" sets G55 to `g55_mm` in the program. Inch or metric and 3 to 5 decimals are drawn unless given.
    """
    rng = np.random.default_rng(seed)
    on = set(features)
    unknown = on - {*FEATURES, *LOOSE}
    if unknown:
        raise ValueError(f"no such feature: {sorted(unknown)}")
    inch = bool(rng.random() < 0.3) if inch is None else inch
    digits = int(rng.choice([3, 4]) + inch) if digits is None else digits
    w = _Writer(rng, 25.4 if inch else 1.0, digits, "style" in on, "numbers" in on, "modal" in on)
    low, high = np.array(range_mm).T
    percent = bool(rng.random() < 0.5)
    if percent:
        w.blocks.append("%")
    if "comments" in on:
        w.blocks.append("(random program: X1 Y2 in a comment is no motion)")
    if "g10" in on:
        g55 = [w.value(w.round(v)) for v in g55_mm]
        w.line("G20" if inch else "G21", "G90")
        w.line("G10 L2 P2", *(letter + text for letter, text in zip("XYZ", g55, strict=True)))
    w.line("G20" if inch else "G21", "G90", "G17", "G40", "G49", "G80")
    w.line("G94", "G54")
    if "tools" in on:
        w.line("T1", "M6")
        w.line("G43", "H1")
    w.line("S1000", "M3", comment=" ; spindle" if "comments" in on else "")
    speed = w.value(w.round(1200.0))
    start = [w.round(float(v)) for v in rng.uniform(low, high)]
    w.position = [math.nan] * 3
    modal, w.modal = w.modal, False
    if "blind" in on:
        _in_two(w, start)
    else:
        w.go("G0", start)
    w.modal = modal
    w.line(f"F{speed}")
    kinds = [kind for kind in (*FEATURES, *LOOSE) if kind in on and kind in _SECTIONS]
    for _ in range(blocks if kinds else 0):
        if "comments" in on and rng.random() < 0.2:
            w.blocks.append(str(rng.choice(["(G1 X9 Y9)", "; a remark, X1", "", "(MSG, part)"])))
        _SECTIONS[str(rng.choice(kinds))](w, low, high)
    w.line("G80", "M5", "M9")
    w.line("M30" if rng.random() < 0.5 else "M2")
    if percent:
        w.blocks.append("%")
    end = "\r\n" if "style" in on and rng.random() < 0.3 else "\n"
    return (end.join(w.blocks) + end).encode("ascii")


def _point(w: _Writer, low: np.ndarray, high: np.ndarray) -> list[float]:
    target = [w.round(float(v)) for v in w.rng.uniform(low, high)]
    for i in range(3):
        if w.rng.random() < 0.35:
            target[i] = w.position[i]
    return target


def _lines(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    for _ in range(3):
        w.go("G1", _point(w, low, high))


def _rapid(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    w.go("G0", _point(w, low, high))


def _short(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    for _ in range(15):
        step = w.rng.normal(size=3) * [0.8, 0.8, 0.2]
        target = np.clip(np.array(w.position) * w.scale + step, low, high)
        w.go("G1", [w.round(float(v)) for v in target])


def _incremental(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    w.line("G91")
    w.relative = True
    (_short if w.rng.random() < 0.5 else _lines)(w, low, high)
    w.line("G90")
    w.relative = False


def _fit(w: _Writer, low: np.ndarray, high: np.ndarray, axes: tuple[int, int]) -> tuple[list[float], float]:
    """A centre (mm, in the plane) and radius of a circle through the present point that stays in range."""
    here = [w.position[i] * w.scale for i in axes]
    for _ in range(50):
        radius, angle = float(w.rng.uniform(1.5, 15.0)), float(w.rng.uniform(0, 2 * np.pi))
        centre = [here[0] + radius * math.cos(angle), here[1] + radius * math.sin(angle)]
        if all(low[i] + radius <= c <= high[i] - radius for i, c in zip(axes, centre, strict=True)):
            return centre, radius
    middle = [0.5 * (low[i] + high[i]) for i in axes]
    target = list(w.position)
    for i, c in zip(axes, middle, strict=True):
        target[i] = w.round(c)
    w.go("G1", target)
    return [middle[0] + 2.0, middle[1]], 2.0


def _arc_words(w: _Writer, axes: tuple[int, int], centre: list[float]) -> list[str]:
    """I, J, K words of the exact centre, rounded; zero ones may be left out."""
    words = []
    offsets = [w.round(c - w.position[i] * w.scale) for i, c in zip(axes, centre, strict=True)]
    for i, value in zip(axes, offsets, strict=True):
        if value == 0.0 and any(offsets) and w.modal:
            continue
        words.append("IJK"[i] + w.value(value))
    return words


def _one_arc(w: _Writer, low: np.ndarray, high: np.ndarray, plane: int, how: str) -> None:
    axes = ((0, 1), (0, 2), (1, 2))[plane]
    normal = 3 - sum(axes)
    centre, radius = _fit(w, low, high, axes)
    words = _arc_words(w, axes, centre)
    start = [w.position[i] * w.scale for i in axes]
    middle = [s + w.round(c - s) * w.scale for s, c in zip(start, centre, strict=True)]
    radius = math.dist(start, middle)
    code = str(w.rng.choice(["G2", "G3"]))
    target = list(w.position)
    if how == "circle" and w.rng.random() < 0.5:  # the end point left out; elsewhere it may be written
        w.line(code, *words)
        w.motion = code
        return
    begin = math.atan2(start[1] - middle[1], start[0] - middle[0])
    angle = begin + float(w.rng.uniform(0.3, 5.8))
    if how != "circle":
        for i, c, part in zip(axes, middle, (math.cos(angle), math.sin(angle)), strict=True):
            target[i] = w.round(c + radius * part)
    if how == "helix":
        target[normal] = w.round(float(w.rng.uniform(low[normal], high[normal])))
        if w.rng.random() < 0.3:
            words.append(f"P{int(w.rng.integers(2, 4))}")
    if how == "radius":
        chord = math.dist(start, [target[i] * w.scale for i in axes])
        if chord > 1.9 * radius or chord < 0.2 * radius:
            return
        turn = np.mod((angle - begin) * (-1.0 if (code == "G2") != (plane == 1) else 1.0), 2 * np.pi)
        words = ["R" + w.value(w.round(radius if turn < np.pi else -radius))]
    w.go(code, target, *words)


def _arcs(w: _Writer, low: np.ndarray, high: np.ndarray, how: str = "arc") -> None:
    for _ in range(2):
        _one_arc(w, low, high, 0, how)


def _planes(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    plane = int(w.rng.integers(1, 3))
    w.line(("G17", "G18", "G19")[plane])
    for how in ("arc", "circle", "radius"):
        _one_arc(w, low, high, plane, how)
    w.line("G17")


def _helix(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    _arcs(w, low, high, "helix")


def _circle(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    _arcs(w, low, high, "circle")


def _radius(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    _arcs(w, low, high, "radius")


def _reposition(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    """All three axes by name, as after a change of frame."""
    target = [w.round(float(v)) for v in w.rng.uniform(low, high)]
    modal, w.modal = w.modal, False
    w.position = [math.nan] * 3
    w.go("G0", target)
    w.modal = modal


def _frames(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    w.line("G55")
    _reposition(w, low, high)
    _lines(w, low, high)
    w.line("G54")
    _reposition(w, low, high)


def _tools(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    number = int(w.rng.integers(1, 3))
    w.line(f"T{number}", "M6")
    w.line("G43", f"H{number}")
    _reposition(w, low, high)
    _lines(w, low, high)


def _cycles(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    top, bottom = w.round(high[2] - 5.0), w.round(low[2] + 1.0)
    clear = w.round(high[2])
    w.go("G0", [w.position[0], w.position[1], clear])
    back = str(w.rng.choice(["G98", "G99"]))
    peck = w.rng.random() < 0.4
    holes = [[w.round(float(v)) for v in w.rng.uniform(low[:2], high[:2])] for _ in range(3)]
    first = True
    for x, y in holes:
        words = [f"X{w.value(x - w.offset[0])}", f"Y{w.value(y - w.offset[1])}"]
        if first:
            words = [back, "G83" if peck else "G81", *words]
            words += [f"Z{w.value(bottom - w.offset[2])}", f"R{w.value(top - w.offset[2])}"]
            words += [f"Q{w.value(w.round(15.0))}"] if peck else []
        w.line(*words)
        first = False
    w.line("G80")
    w.motion = ""
    w.position = [*holes[-1], clear if back == "G98" else top]


def _g92(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    new = [w.round(float(v)) for v in w.rng.uniform(-5, 5, 3)]
    w.line("G92", *(letter + w.value(v) for letter, v in zip("XYZ", new, strict=True)))
    w.offset = [round(a - n, w.digits) for a, n in zip(w.position, new, strict=True)]
    _lines(w, low, high)
    w.line("G92.1")
    w.offset = [0.0] * 3


def _g52(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    w.offset = [w.round(float(v)) for v in w.rng.uniform(-5, 5, 3)]
    w.line("G52", *(letter + w.value(v) for letter, v in zip("XYZ", w.offset, strict=True)))
    _lines(w, low, high)
    w.line("G52", "X0", "Y0", "Z0")
    w.offset = [0.0] * 3


def _whole_point(w: _Writer, low: np.ndarray, high: np.ndarray) -> list[float]:
    return [w.round(float(v)) for v in w.rng.uniform(low, high)]


def _in_two(w: _Writer, target: list[float]) -> None:
    """To a point where nothing is known: two axes as a rapid, then the third as a rapid or as a feed."""
    third = int(w.rng.integers(3))
    w.line("G0", *("XYZ"[i] + w.value(target[i] - w.offset[i]) for i in range(3) if i != third))
    code = str(w.rng.choice(["G0", "G1"]))
    w.line(code, "XYZ"[third] + w.value(target[third] - w.offset[third]), f"F{w.value(w.round(1200.0))}")
    w.motion = code
    w.position = list(target)


def _blind(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    """A tool change, after which the axes are commanded one after the other, and a cut."""
    number = int(w.rng.integers(1, 3))
    w.line(f"T{number}", "M6")
    w.line("G43", f"H{number}")
    w.motion = ""
    _in_two(w, _whole_point(w, low, high))
    w.go("G1", _point(w, low, high))


def _feeds_on(w: _Writer, low: np.ndarray, high: np.ndarray, moved: str) -> None:
    """A cut from where a machine position left the axes of `moved`: at once, or after rapids of others."""
    start = list(w.position)
    for letter in moved:
        w.position["XYZ".index(letter)] = math.nan
    w.motion = ""
    how = w.rng.random()
    if how < 0.4:
        target = _whole_point(w, low, high)
        rest = [i for i in range(3) if "XYZ"[i] not in moved]
        w.line("G0", *("XYZ"[i] + w.value(target[i] - w.offset[i]) for i in rest))
        start = [target[i] if i in rest else start[i] for i in range(3)]
        w.position = [target[i] if i in rest else math.nan for i in range(3)]
        w.motion = "G0"
    modal, w.modal = w.modal, False
    target = _whole_point(w, low, high)
    if how > 0.8:
        w.go("G0", target)
    else:
        w.position = [math.nan] * 3
        w.go("G1", target)
    w.modal = modal
    _lines(w, low, high)


def _machine(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    """G53: to a position of the machine."""
    axis = str(w.rng.choice(["Z", "Z", "X", "Y"]))
    place = {"X": (200.0, 500.0), "Y": (150.0, 400.0), "Z": (-120.0, -40.0)}[axis]
    w.line("G53", "G0", axis + w.value(w.round(float(w.rng.uniform(*place)))))
    _feeds_on(w, low, high, axis)


def _home(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    """G28: to the reference point, and back by all axes."""
    w.line("G91", "G28", "Z0")
    w.line("G90")
    w.motion = ""
    _in_two(w, _whole_point(w, low, high))
    _lines(w, low, high)


def _off(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    """A section that is left uncorrected, and a cut from where it ends."""
    w.blocks.append("(olp off)")
    modal, w.modal = w.modal, False
    for _ in range(int(w.rng.integers(1, 4))):
        w.go(str(w.rng.choice(["G0", "G1"])), _whole_point(w, low, high))
    w.blocks.append("(olp on)")
    w.go("G1", _whole_point(w, low, high))
    w.modal = modal
    w.go("G1", _point(w, low, high))


def _deleted(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    """A block that the switch deletes, and one with all axes."""
    modal, w.modal = w.modal, False
    numbers, w.numbers = w.numbers, False
    w.go("G1", _whole_point(w, low, high))
    w.blocks[-1] = "/" + w.blocks[-1]
    w.go(str(w.rng.choice(["G0", "G1"], p=[0.9, 0.1])), _whole_point(w, low, high))
    w.modal, w.numbers = modal, numbers


def _series(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    """Canned cycles of several kinds, each series followed at once by a cut."""
    for _ in range(int(w.rng.integers(1, 3))):
        top, bottom = w.round(high[2] - 5.0), w.round(float(w.rng.uniform(low[2], low[2] + 8.0)))
        clear = w.round(high[2])
        if w.rng.random() < 0.7:
            w.go("G0", [w.position[0], w.position[1], clear])
        initial = w.position[2]
        if initial < top:
            w.go("G0", [w.position[0], w.position[1], clear])
            initial = clear
        back = str(w.rng.choice(["G98", "G99"]))
        code = str(w.rng.choice(["G81", "G82", "G83", "G73", "G85", "G89"]))
        extra = {"G82": ["P0.1"], "G89": ["P0.1"]}.get(code, [])
        if code in ("G83", "G73"):
            extra = [f"Q{w.value(w.round(float(w.rng.uniform(6.0, 15.0))))}"]
        place = [w.position[0], w.position[1]]
        for hole in range(int(w.rng.integers(1, 4))):
            if hole or w.rng.random() < 0.7:
                place = [w.round(float(v)) for v in w.rng.uniform(low[:2], high[:2])]
            words = [f"X{w.value(place[0] - w.offset[0])}", f"Y{w.value(place[1] - w.offset[1])}"]
            if not hole:
                words = [back, code, *words, f"Z{w.value(bottom - w.offset[2])}"]
                words += [f"R{w.value(top - w.offset[2])}", *extra]
            w.line(*words)
        w.line("G80")
        w.motion = ""
        w.position = [*place, initial if back == "G98" else top]
        w.go("G1", _point(w, low, high))


def _joint(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    """Single feeds and rapids by turns."""
    for _ in range(3):
        w.go("G0", _point(w, low, high))
        w.go("G1", _point(w, low, high))


def _dwell(w: _Writer, low: np.ndarray, high: np.ndarray) -> None:
    w.line("G4", "P0.1")


_SECTIONS = {
    "lines": _lines,
    "short": _short,
    "rapid": _rapid,
    "arcs": _arcs,
    "planes": _planes,
    "helix": _helix,
    "circle": _circle,
    "radius": _radius,
    "incremental": _incremental,
    "frames": _frames,
    "tools": _tools,
    "cycles": _cycles,
    "g92": _g92,
    "g52": _g52,
    "dwell": _dwell,
    "blind": _blind,
    "machine": _machine,
    "home": _home,
    "off": _off,
    "deleted": _deleted,
    "series": _series,
    "joint": _joint,
}


def polyline_program(points_mm: np.ndarray, digits: int = 6, *, first_rapid: bool = True) -> bytes:
    """Plain absolute millimetre program through work coordinates (n, 3), every word written."""
    rows = [f"X{x:.{digits}f} Y{y:.{digits}f} Z{z:.{digits}f}" for x, y, z in points_mm.tolist()]
    codes = ["G0" if first_rapid else "G1", *["G1"] * (len(rows) - 1)]
    body = "\n".join(f"{code} {row}" for code, row in zip(codes, rows, strict=True))
    return f"G21 G90 G94 G17 G54\nF1000\n{body}\nM2\n".encode("ascii")
