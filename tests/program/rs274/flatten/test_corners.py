"""Corners of ISO controls (`,R` and `,C`), against what defines them: circles that touch both moves, and
points as far from the corner on both. A reader of its own follows the moves that are written."""

from __future__ import annotations

import cmath
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from cases.unrolling import flatten, refused
from judge import iso_frames, machines
from judge.machines import Recipe

import olp

HEAD = "G21 G17 G90\nG0 X0. Y0. Z9.\n"
#: A quarter of a circle about X80 Y0 between two lines, both square to it.
ARC = "G1 X60. F300. ,R{0}\nG2 X80. Y20. {1} ,R{0}\nG1 Y60.\n"


def unrolled(body: str, control: str = "fanuc") -> str:
    text = flatten(f"{HEAD}{body}M30\n".encode(), profile=control).decode()
    return text.removeprefix(HEAD).removesuffix("M30\n")


def points(text: str) -> list[list[complex]]:
    """The points of each move behind the first, its begin first; arcs in a thousand."""
    moves = [cut.points for cut in iso_frames.cuts(HEAD + text, 1000)]
    ends = [[w for w, _ in move] for move in moves]
    return [[before[-1], *own] for before, own in pairwise(ends)]


@pytest.mark.parametrize("incremental", [False, True])
def test_a_rounding_touches_both_lines_at_the_length_of_its_tangent(incremental: bool) -> None:
    rng = np.random.default_rng(4)
    corners = np.cumsum(rng.uniform(-1, 1, (40, 2)) * 9 + [12, 0], axis=0).round(3)
    line = [complex(0, 0), *(complex(*c) for c in corners)]
    sizes = rng.uniform(0.2, 1.2, 39).round(2)
    steps = [b - a for a, b in pairwise(line)] if incremental else line[1:]
    words = [f"X{w.real:.3f} Y{w.imag:.3f}" for w in steps]
    body = "".join(f"{w} ,R{r}\n" for w, r in zip(words, sizes, strict=False)) + words[-1] + "\n"
    moves = points(unrolled(f"{'G91 ' if incremental else ''}G1 F300.\n{body}"))
    assert len(moves) == 79
    for k, radius in enumerate(sizes):
        before, corner, behind = line[k : k + 3]
        a, b = (v / abs(v) for v in (corner - before, behind - corner))
        tangent = radius * math.tan(abs(cmath.phase(b / a)) / 2)
        assert moves[2 * k][-1] == pytest.approx(corner - tangent * a, abs=2e-4)
        own = moves[2 * k + 1]
        assert own[-1] == pytest.approx(corner + tangent * b, abs=2e-4)
        centre = own[0] + a * radius * (1j if (b / a).imag > 0 else -1j)
        assert max(abs(abs(w - centre) - radius) for w in own) < 1e-3
        # the short way round
        assert sum(abs(v - u) for u, v in pairwise(own)) < math.pi * radius
    assert abs(moves[-1][-1] - line[-1]) < 1e-9


def test_a_chamfer_takes_the_same_of_both_moves() -> None:
    text = unrolled("G1 X30. F300. ,C4.\nX60. Y40. ,C2.5\nY90.\n", "haas")
    moves = points(text)
    assert [abs(move[-1] - move[0]) for move in moves][1] == pytest.approx(
        8 * math.cos(math.atan2(4, 3) / 2), abs=1e-3
    )
    assert moves[0][-1] == pytest.approx(26)
    assert abs(moves[1][-1] - 30) == pytest.approx(4, abs=1e-4)
    assert abs(moves[2][-1] - (60 + 40j)) == pytest.approx(2.5, abs=1e-4)
    assert moves[4] == [60 + 42.5j, 60 + 90j]


@pytest.mark.parametrize("size", [0.5, 3.0, 8.5])
@pytest.mark.parametrize("circle", ["R20.", "I20. J0."])
def test_a_rounding_beside_arcs_touches_them(size: float, circle: str) -> None:
    """How far apart centres of circles that touch are follows from their radii."""
    moves = points(unrolled(ARC.format(size, circle)))
    assert len(moves) == 5
    arc, about = moves[2], 80 + 0j
    assert max(abs(abs(w - about) - 20) for w in arc) < 2e-3
    # both lie outside of the circle, the first above the line, the second to the left of it
    first = about + complex(-math.sqrt((20 + size) ** 2 - size**2), size)
    second = about + complex(-size, math.sqrt((20 + size) ** 2 - size**2))
    for own, centre in ((moves[1], first), (moves[3], second)):
        assert max(abs(abs(w - centre) - size) for w in own) < 1e-3
    for before, behind in pairwise(moves):
        turn = cmath.phase((behind[1] - behind[0]) / (before[-1] - before[-2]))
        assert abs(turn) < 0.02


def test_what_stands_beside_a_corner_stays_in_its_block() -> None:
    text = unrolled("N5 G1 X30. F300. ,R5. (CORNER)\n(a note)\nN6 Y40. F200. M8\nX0.\n", "mazak")
    assert text == ("N5 G1 X25. F300. (CORNER)\n(a note)\nG3 X30. Y5. R5.\nN6 G1 Y40. F200. M8\nX0.\n")
    # tangential moves have no corner
    assert unrolled("G1 X30. F300. ,R5.\nX40.\n") == "G1 X30. F300.\nX40.\n"


@pytest.mark.parametrize(
    ("body", "code", "why", "line"),
    [
        ("G1 X30. F300. ,R5.\nG0 Y40.\n", "OLP544", "no G1, G2 or G3", 3),
        ("G1 X30. F300. ,R5.\nM8\nY40.\n", "OLP544", "no G1, G2 or G3", 3),
        ("G1 X30. F300. ,R5.\nY40. A5.\n", "OLP544", "no G1, G2 or G3", 3),
        ("G1 X30. F300. ,R5.\nY40. Z1.\n", "OLP524", "in its plane alone", 3),
        ("G0 X30. ,R5.\nG1 Y40. F300.\n", "OLP544", "no G1, G2 or G3", 3),
        ("G54\nG1 X30. F300. ,R5.\nY40.\n", "OLP524", "begins where no block says", 4),
        ("G1 X30. F300. ,R5.\n", "OLP544", "no G1, G2 or G3", 3),
        ("G1 X30. F300. ,R40.\nY40.\n", "OLP544", "does not fit", 3),
        ("G1 X30. F300. ,R5\nY40.\n", "OLP515", "no decimal point", 3),
        ("G1 X30. F300. ,R-5.\nY40.\n", "OLP516", "no size", 3),
        ("G1 X30. F300. ,R5. ,C2.\nY40.\n", "OLP518", "two corners", 3),
        ("G1 X30. F300. ,R5.\nX60. Y0.2\n", "OLP544", "less than a degree", 3),
        ("G1 X30. F300. ,C5.\nG2 X40. Y10. R10.\n", "OLP544", "beside an arc", 3),
        ("G1 X30. F300. ,R5. M5\nY40.\n", "OLP544", "whether M5 acts before or behind", 3),
        ("G1 X30. F300. ,R5. M00\nY40.\n", "OLP544", "whether M0 acts before or behind", 3),
        ("G81 X30. Z-3. R1. F300. ,R5.\nG80\n", "OLP510", "canned cycle", 3),
    ],
)  # fmt: skip
def test_what_is_not_certain_is_refused(body: str, code: str, why: str, line: int) -> None:
    got, message, at = refused(f"{HEAD}{body}M30\n", "fanuc")
    assert (got, at) == (code, line), message
    assert why in message


def test_a_plain_program_with_corners_is_corrected_as_it_is(tmp_path: Path) -> None:
    """The corners are written out unasked; the second pass of a subprogram has them, too."""
    path = machines.random_machine(tmp_path, 5, Recipe(controller="fanuc", off_datum=True))
    corner = "G1 X30. F300. ,R5.\nY40.\nG0 Z9.\n"
    for body in (f"{corner}M30\n", f"M98 P7\nM98 P7\nM30\nO7\nG0 X0. Y0.\n{corner}M99\n"):
        text = f"O1\n{HEAD}{body}".encode()
        done = olp.correct(text, path)
        asked = olp.correct(text, path, flatten=True)
        assert done.report["deviation"]["holds"]
        assert b",R" not in done.data.partition(b"M30")[0]
        assert any(f.code == "OLP110" for f in done.findings)
        ends = [olp.simulate(some.data, path, step_mm=1e4).points_mm for some in (done, asked)]
        np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)


def test_a_corner_is_turned_with_its_frame() -> None:
    body = "G0 X0. Y0.\nG1 X30. F300. ,R5.\nY40.\n"
    plain, turned = (unrolled(f"{code}\n{body}G69\n") for code in ("G80", "G68 X1. Y2. R30."))
    assert turned == plain.replace("G80", "G68 X1. Y2. R30.")
    for code, line in (("G68 X1. Y2. R30.", 4), ("G51 X0. Y0. Z0. P2.\nG0 X0. Y0.", 5)):
        said, _, at = refused(f"{HEAD}{code}\nG1 X30. F300. ,R5.\nY40.\nM30\n", "fanuc")
        assert (said, at) == ("OLP524", line)
