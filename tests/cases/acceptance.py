"""What the acceptance tests share: small machines, a judge that separates near passes, a plain reader.

The judge is `judge` alone; nothing here asks olp how good its own output is.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from judge import linuxcnc
from judge.linuxcnc import DWELL, RAPID, CanonMoves
from judge.model import JudgeModel
from judge.path import ActualPath, Deviation, _Curves, _forget, _measure, actual, match, shifts

CUTTING = ("feed", "arc", "probe")
TOLERANCE_UM = 1.0
#: half the diagonal of a cube of one digit
ROUNDING = 0.87
#: mm of extra distance per mm of path, so that passes over one position are separated
_LIFT = 0.05
#: mm of extra distance between moves of different kinds
APART_MM = 100.0

_AXIS = "[axes.{}]\ntravel_mm = [-1000.0, 2000.0]\nleast_increment_mm = {}\nvelocity_mm_s = 500.0\n"
_AXIS += "acceleration_mm_s2 = 2000.0\njerk_mm_s3 = 20000.0\n"
_STAMP = re.compile(rb"(?m)^.*olp-corrected [0-9a-f]{12}.*\n")


#: of an adjustment that fits
QUALITY = "\n[quality]\nchi_square = 99.0\ndegrees_of_freedom = 100.0\n"


def machine(
    folder: Path,
    calibration: str = "",
    curves: Mapping[str, str] | None = None,
    *,
    chain: str = "FXYZ",
    controller: str = "linuxcnc",
    keys: str = "",
    tables: str = "",
    job: str | None = None,
    increment_mm: float = 0.001,
) -> Path:
    """A machine with 3 m of travel and box all around, from the text that matters; returns machine.toml."""
    folder.mkdir(parents=True, exist_ok=True)
    axes = "".join(_AXIS.format(a, increment_mm) for a in "XYZ")
    (folder / "machine.toml").write_text(
        f'schema = "olp-machine-1"\nname = "m"\nchain = "{chain}"\ncontroller = "{controller}"\n'
        f'calibration = "calibration.toml"\n{keys}\n{axes}{tables}\n'
    )
    if "[quality]" not in calibration:
        calibration += QUALITY
    if "datum_mm" not in calibration:
        calibration = "datum_mm = [0.0, 0.0, 0.0]\n" + calibration
    box = "[[-1000.0, 2000.0], [-1000.0, 2000.0], [-1000.0, 2000.0]]"
    (folder / "calibration.toml").write_text(
        'schema = "olp-calibration-1"\nmachine = "m"\nmeasured = 2026-01-15\nvalid_until = 2099-01-01\n'
        f'sign = "actual-minus-commanded"\nmodel = "rigid-body"\nbox_mm = {box}\n'
        f"temperature_degC = 20.0\n{calibration}\n"
    )
    for name, text in (curves or {}).items():
        (folder / name).write_text(text)
    if job is not None:
        (folder / "job.toml").write_text(f'schema = "olp-job-1"\nmachine = "machine.toml"\n{job}\n')
    return folder / "machine.toml"


TRUE_ZERO = '[work_offsets.G54]\nset_by = "true"\n'


def unstamped(text: bytes) -> bytes:
    """A corrected text without its stamp line."""
    return _STAMP.sub(b"", text, count=1)


def words(text: bytes, letter: str) -> list[float]:
    """Numbers behind one letter, comments left out."""
    plain = re.sub(rb"\([^)\n]*\)|;[^\n]*", b"", text)
    pattern = (letter + r"\s*([+-]?\d*\.?\d+|[+-]?\d+\.)").encode()
    return [float(value) for value in re.findall(pattern, plain, re.IGNORECASE)]


def points(text: bytes, start: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """(n, 3) work coordinates after each block with X, Y or Z, in one frame; knows G90 and G91 only."""
    position, relative, points = list(start), False, []
    plain = re.sub(rb"\([^)\n]*\)|;[^\n]*", b"", text).upper()
    for block in plain.splitlines():
        if b"G91" in block:
            relative = True
        elif b"G90" in block:
            relative = False
        words = re.findall(rb"([XYZ])\s*([+-]?\d*\.?\d+|[+-]?\d+\.)", block)
        for letter, number in words:
            axis = b"XYZ".index(letter)
            position[axis] = float(number) + (position[axis] if relative else 0.0)
        if words:
            points.append(list(position))
    return np.array(points).reshape(-1, 3)


def judged(
    nominal: bytes,
    corrected: bytes,
    folder: Path,
    *,
    kinds: tuple[str, ...] = CUTTING,
    spacing_mm: float = 1.0,
    skip_lines: tuple[int, ...] = (),
    interpreter: Mapping[str, Any] | None = None,
    shift_by_frame: Mapping[str, Any] | None = None,
) -> Deviation:
    """As `judge.path.judge_programs`, with the length along the path in the matching.

    Full circles end where they begin; without the length, blocks inserted there could go to the wrong one.
    """
    setup = dict(interpreter or {})
    model = JudgeModel(folder)
    moves, own = (
        _forget(m.pick(m.kind != DWELL))
        for m in (linuxcnc.interpret(text, folder, **setup) for text in (nominal, corrected))
    )
    shift = shifts(moves, model, shift_by_frame)
    uncorrected = np.isin(moves.line, list(skip_lines))
    real = _sure_of_play(actual(own, model, spacing_mm), model)
    ends = real.points[real.dense.last] + apart(own)
    groups = matched(ends, own, moves.axis + shift + apart(moves), moves)
    after = _measure(real, groups, moves, shift, uncorrected, kinds)
    before = _measure(
        _sure_of_play(actual(moves, model, spacing_mm), model),
        np.arange(len(moves)),
        moves,
        shift,
        uncorrected,
        kinds,
    )
    return Deviation(after, before, moves.line, groups)


def _sure_of_play(real: ActualPath, model: JudgeModel) -> ActualPath:
    """A tool change may move the axes: their play is unknown until they have moved by it once more.

    No command is right for all of a move that begins with an unknown play; for its end one is.
    """
    dense, known = real.dense, real.dense.moves.known
    before = np.vstack([np.full((1, 3), real.dense.moves.start_known), known[:-1]])
    settled = (known & before)[dense.move] | (known[dense.move] & dense.last[:, None])
    edges = [0, *(np.flatnonzero(np.diff(dense.moves.tool[dense.move])) + 1).tolist(), len(dense.move)]
    determined = real.determined.copy()
    for axis in np.flatnonzero(model.has_play).tolist():
        place = np.where(settled[:, axis], dense.points[:, axis], np.nan)
        lost = model.backlash_at(axis, np.clip(dense.points[:, axis], *model.box[axis]))
        for a, b in itertools.pairwise(edges):
            moved = np.fmax.accumulate(place[a:b]) - np.fmin.accumulate(place[a:b])
            determined[a:b] &= np.nan_to_num(moved) >= lost[a:b]
    at_begin = np.concatenate([[True], determined[:-1]])
    first = np.concatenate([[True], np.diff(dense.move) != 0])
    begun = at_begin[np.flatnonzero(first)][np.cumsum(first) - 1]
    return replace(real, determined=determined & (begun | dense.last))


def matched(ends: np.ndarray, own: CanonMoves, vertices: np.ndarray, moves: CanonMoves) -> np.ndarray:
    """As `judge.path.match`, with the length along the path in the third axis.

    Corrected and nominal lengths drift apart: the second time they count from the first matches.
    """
    length, nominal = (np.cumsum(_Curves.of(path).lengths()) for path in (own, moves))
    along = np.array([0.0, 0.0, _LIFT])
    there = vertices + np.outer(nominal, along)
    groups = match(ends + np.outer(length, along), there)
    drift = np.interp(np.arange(len(own)), groups, length[groups] - nominal)
    return match(ends + np.outer(length - drift, along), there)


def apart(moves: CanonMoves) -> np.ndarray:
    """(n, 3) mm by which cuts are moved from rapids: a part of a cut is a cut, and never ends a rapid."""
    return np.outer(APART_MM * (moves.kind != RAPID), (1.0, 0.0, 0.0))


def allowed_um(text: bytes) -> float:
    """The bar for a program written with digits of 0.001 mm or 0.00001 in."""
    digit_um = 0.254 if b"G20" in text.upper() else 1.0
    return TOLERANCE_UM + ROUNDING * digit_um
