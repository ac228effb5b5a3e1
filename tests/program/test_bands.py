"""Bands of a program: together they are the program, and each ends at a quiet place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from judge.machines import Recipe, random_machine
from judge.programs import FEATURES, LOOSE, random_program

from olp.core.toolpath import Flag, Kind, Toolpath
from olp.files.config import load_setup
from olp.program import bands as module
from olp.program.bands import Band, bands, spans
from olp.program.program import Program
from olp.program.registry import DIALECTS, Options, read

FEED = (Kind.LINE, Kind.ARC_CW, Kind.ARC_CCW)
HEAD = "G21 G90 G17 G54 G61\nG0 X0 Y0 Z5\nF600\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return random_machine(tmp_path_factory.mktemp("bands"), 1, Recipe())


def program(text: str | bytes, folder: Path) -> Program:
    data = text if isinstance(text, bytes) else (HEAD + text).encode()
    return read(data, load_setup(folder, None), DIALECTS["linuxcnc"])


def of_size(program: Program, size: int, monkeypatch: pytest.MonkeyPatch) -> list[Band]:
    monkeypatch.setattr(module, "SIZE", size)
    return list(bands(program))


def sizes(program: Program, size: int = 1) -> list[int]:
    return [last - first for first, last in spans(program.toolpath, size)]


def joined(parts: Sequence[Toolpath], name: str) -> np.ndarray:
    return np.concatenate([getattr(part, name) for part in parts])


@pytest.mark.parametrize("size", (1, 5))
@pytest.mark.parametrize("seed", range(6))
def test_bands_are_together_the_program(
    seed: int, size: int, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = program(random_program(seed, features=(*FEATURES, *LOOSE), inch=False), folder)
    parts = of_size(whole, size, monkeypatch)
    path, paths = whole.toolpath, [band.program.toolpath for band in parts]
    for name in ("kind", "flag", "line", "frame", "end_mm"):
        np.testing.assert_array_equal(joined(paths, name), getattr(path, name))
    starts = np.concatenate([part.starts_mm() for part in paths])
    np.testing.assert_array_equal(starts, path.starts_mm())
    np.testing.assert_array_equal(np.concatenate([b.program.slot for b in parts]), whole.slot)
    moves = np.concatenate([band.first + band.program.toolpath.arcs.move for band in parts])
    np.testing.assert_array_equal(moves, path.arcs.move)
    for name in ("centre_mm", "plane", "sweep_rad"):
        arcs = np.concatenate([getattr(part.arcs, name) for part in paths])
        np.testing.assert_array_equal(arcs, getattr(path.arcs, name))
    slots = np.concatenate([band.program.arc_slots.word for band in parts])
    np.testing.assert_array_equal(slots, whole.arc_slots.word)
    holes = [
        (band.first + h.first, band.first + h.last, h.line) for band in parts for h in band.program.holes
    ]
    assert holes == [(h.first, h.last, h.line) for h in whole.holes]
    rests = [h.rests for band in parts for h in band.program.holes]
    assert rests == [h.rests for h in whole.holes]
    captures = [replace(c, moves=c.moves + band.first) for band in parts for c in band.program.captures]
    assert captures == list(whole.captures)
    ends = [band.end for band in parts]
    assert ends == sorted(ends) and ends[-1] == len(whole.data)
    assert [band.until for band in parts[:-1]] == [band.share for band in parts[1:]]


@pytest.mark.parametrize("seed", range(6))
def test_bands_end_at_quiet_places(seed: int, folder: Path) -> None:
    path = program(random_program(seed, features=(*FEATURES, *LOOSE), inch=False), folder).toolpath
    cuts = [last for _, last in spans(path, 1)][:-1]
    assert cuts
    loud = np.uint8(~(Flag.WHOLE | Flag.INCREMENTAL | Flag.INVERSE_TIME) & 255)
    for k in cuts:
        assert path.kind[k - 1] in FEED and path.kind[k] in FEED
        assert path.flag[k - 1] == path.flag[k] and not path.flag[k] & loud
        assert path.frame[k - 1] == path.frame[k] and path.line[k - 1] < path.line[k]


def test_a_band_has_the_ends_of_the_moves_behind_it(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "AHEAD", 3)
    whole = program("G1 X1\nX2\nX3\nX4\nX5\nX6\n", folder)
    parts = of_size(whole, 2, monkeypatch)
    assert [band.first for band in parts] == [0, 2, 4, 6]
    ends = whole.toolpath.end_mm
    for band, last in zip(parts, (2, 4, 6, 7), strict=True):
        np.testing.assert_array_equal(band.ahead_mm, ends[last : last + 3])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("G1 X1\nX2\nX3\n", [2, 1, 1]),
        ("G1 X1\nG0 X2\nG1 X3\nX4\n", [4, 1]),
        ("G1 X1\n/X2\nX3\nX4\n", [4, 1]),
        ("G1 X1\nG55\nX2\nX3\n", [3, 1]),
        ("G1 X1\nG91\nX2\nX3\n", [3, 1]),
        ("G1 X1\nG81 X5 Z-1 R1\nX6\nG80\nG1 X7\nX8\n", None),
        ("G1 X1\nG3 X3 I1\nG1 X4\n", [2, 1, 1]),
        ("", [1]),
    ],
)
def test_what_is_quiet(text: str, expected: list[int] | None, folder: Path) -> None:
    whole = program(text, folder)
    if expected is None:
        expected = [len(whole.toolpath) - 1, 1]
    assert sizes(whole) == expected


def test_behind_a_contour_no_place_is_quiet(folder: Path) -> None:
    text = HEAD + "G1 X1\nX2\nG41 D1\nX20\nX40\nG40\nX60\nX70\nX80\n"
    setup = load_setup(folder, None)
    whole = read(text.encode(), setup, DIALECTS["linuxcnc"], Options())
    on = int(np.argmax(whole.toolpath.compensated()))
    assert on > 0
    *before, last = list(spans(whole.toolpath, 1))
    assert last[1] == len(whole.toolpath) and all(end <= on for _, end in before)


def test_a_program_without_moves_is_one_band(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (band,) = of_size(read(b"G21 G90\nM2\n", load_setup(folder, None), DIALECTS["linuxcnc"]), 1, monkeypatch)
    assert len(band.program.toolpath) == 0 and band.end == 11
