"""The proof of two programs: how each move counts, what it is off, what is refused, and its figures."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from cases.paths import (
    CONTROL,
    CYCLE,
    NAN,
    OF_MACHINE,
    PASS,
    WHOLE,
    Known,
    Move,
    columns,
    hole,
    line,
    program,
    rapid,
    toolpath,
    wave,
)

from olp.core.arrays import Array
from olp.core.errors import ProgramError
from olp.core.toolpath import Frame, Kind
from olp.program.holes import Hole
from olp.program.program import Program
from olp.program.registry import DIALECTS
from olp.proof import proof as module
from olp.proof.deviation import Deviation
from olp.proof.proof import (
    Counts,
    Proof,
    Side,
    corrections_mm,
    largest_correction_mm,
    prove,
    uncorrected_starts,
)

TOLERANCE_MM = 1e-3
DIGIT_MM = 1e-4


def proved(
    nominal: Program, corrected: Program | None = None, model: Known | None = None, **more: Any
) -> Proof:
    values = {"tolerance_mm": TOLERANCE_MM, "digit_mm": DIGIT_MM, "uncorrected": np.zeros(0, np.int64)} | more
    return prove(nominal, nominal if corrected is None else corrected, model or Known(), **values)


def of(*moves: Move, holes: tuple[Hole, ...] = (), dialect: str = "linuxcnc", **more: Any) -> Program:
    return program(toolpath(*moves, **more), *holes, dialect=DIALECTS[dialect])


def aside(axis_mm: Array) -> Array:
    """2 um aside everywhere."""
    return np.where(np.isnan(axis_mm), NAN, [0.0, 0.002, 0.0])


# -- how moves count -------------------------------------------------------------------------------------

NONE = (NAN, NAN, NAN)
CUT = line(5, 5, 5)


@pytest.mark.parametrize(
    ("move", "counts", "left"),
    [
        (line(9, 0, 0), Counts.FEED, Counts.LEFT),
        (rapid(9, 0, 0), Counts.RAPID, Counts.UNCORRECTED),
        (Move(Kind.PROBE, (9, 0, 0)), Counts.FEED, Counts.LEFT),
        (Move(Kind.PROBE, (9, 0, 0), WHOLE), Counts.POINT, Counts.LEFT),
        (line(9, 0, 0, flag=CYCLE), Counts.HOLE, Counts.LEFT),
        (rapid(9, 0, 0, flag=CYCLE), Counts.RAPID, Counts.UNCORRECTED),
        (line(9, 0, 0, flag=PASS), Counts.LEFT, Counts.LEFT),
        (line(9, 0, 0, flag=OF_MACHINE), Counts.LEFT, Counts.LEFT),
        (line(9, 0, 0, flag=CONTROL), Counts.UNCORRECTED, Counts.UNCORRECTED),
        (rapid(9, 0, 0, flag=PASS), Counts.UNCORRECTED, Counts.UNCORRECTED),
        (rapid(9, 0, 0, flag=OF_MACHINE), Counts.UNCORRECTED, Counts.UNCORRECTED),
        (line(9, 0, NAN), Counts.FEED, Counts.LEFT),
        (line(9, 0, NAN, flag=CYCLE), Counts.UNKNOWN, Counts.UNCORRECTED),
        (line(*NONE), Counts.UNKNOWN, Counts.UNCORRECTED),
        (rapid(*NONE), Counts.RAPID, Counts.UNCORRECTED),
        (Move(Kind.PROBE, NONE, WHOLE), Counts.UNKNOWN, Counts.UNCORRECTED),
        (line(*NONE, flag=PASS), Counts.UNCORRECTED, Counts.UNCORRECTED),
    ],
)
def test_how_a_move_counts_and_how_if_it_is_left_uncorrected(
    move: Move, counts: Counts, left: Counts
) -> None:
    path = of(rapid(0, 0, 0), CUT, move, rapid(1, 1, 1))
    got = proved(path)
    assert Counts(got.counts[2]) == counts
    assert got.counts[[0, 1, 3]].tolist() == [Counts.RAPID, Counts.FEED, Counts.RAPID]
    assert Counts(proved(path, uncorrected=np.array([2])).counts[2]) == left
    assert got.judged.tolist() == [False, True, counts <= Counts.LEFT, False]


@pytest.mark.parametrize("dialect", ("linuxcnc", "dmis"))
def test_points_count_where_nothing_cuts_or_the_dialect_states_them(dialect: str) -> None:
    moves = (rapid(0, 0, 0), rapid(9, 0, 0, flag=PASS), rapid(9, 9, 0))
    alone = proved(of(*moves, dialect=dialect), model=Known(aside))
    assert alone.counts.tolist() == [Counts.POINT, Counts.UNCORRECTED, Counts.POINT]
    assert 1e3 * alone.after_mm[[0, 2]] == pytest.approx([2.0, 2.0], rel=1e-5)
    with_feed = proved(of(*moves, CUT, dialect=dialect)).counts.tolist()
    point = Counts.POINT if dialect == "dmis" else Counts.RAPID
    assert with_feed == [point, Counts.UNCORRECTED, point, Counts.FEED]


# -- the deviations that count ---------------------------------------------------------------------------


def half_wave(axis_mm: Array) -> Array:
    """10 um at X 25, nothing at X 0 and 50, and 4 um aside in Z everywhere."""
    return np.stack(
        (0 * axis_mm[:, 0], 0.01 * np.sin(np.pi * axis_mm[:, 0] / 50), 0.004 + 0 * axis_mm[:, 0]), 1
    )


def test_feeds_count_along_their_path_and_points_at_their_end() -> None:
    model = Known(half_wave, 0.01 * (np.pi / 50) ** 2)
    moves = (rapid(0, 0, 0), line(50, 0, 0), Move(Kind.PROBE, (0.0, 0.0, 0.0), WHOLE), rapid(0, 9, 0))
    got = proved(of(*moves), model=model)
    assert got.judged.tolist() == [False, True, True, False]
    assert 1e3 * got.before_mm[[0, 3]] == pytest.approx([4.0, 4.0], rel=1e-5)
    assert 1e3 * got.before_mm[1:3] == pytest.approx([math.hypot(10, 4), 4.0], abs=0.1)
    np.testing.assert_array_equal(got.before_mm, got.after_mm)


def test_before_is_of_the_nominal_program_and_after_of_the_corrected_one() -> None:
    nominal = of(rapid(0, 0, 0), line(50, 0, 0))
    got = proved(nominal, of(rapid(0, -0.002, 0), line(50, -0.002, 0)), Known(aside))
    assert 1e3 * got.before_mm == pytest.approx([2.0, 2.0], rel=1e-5)
    assert 1e3 * got.after_mm == pytest.approx([0.0, 0.0], abs=1e-5)
    found = [side.summary["waypoints"]["max_um"] for side in (got.before, got.after)]
    assert found == pytest.approx([2.0, 0.0], rel=1e-5, abs=1e-5)
    assert got.written.end_mm[1].tolist() == [50.0, -0.002, 0.0]
    assert (got.tolerance_mm, got.digit_mm, got.groups.tolist()) == (TOLERANCE_MM, DIGIT_MM, [0, 1])


def test_what_a_frame_was_touched_with_moves_its_target() -> None:
    """Touched off where the error is 2 um aside, the part lies there, and the same error is none."""
    frame = Frame(touched=((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    got = proved(of(rapid(0, 0, 0), line(50, 0, 0), frames=(frame,)), model=Known(aside))
    assert 1e3 * got.after_mm[1:] == pytest.approx([0.0], abs=1e-5)


def test_an_unknown_side_of_the_backlash_is_part_of_what_counts() -> None:
    """Feeds, points and holes: 5 um of an axis that has not moved."""
    model = Known(backlash_mm=(0.01, 0.0, 0.0))
    feeds = proved(of(rapid(0, 0, 0), line(0, 9, 0), line(0, 9, 4)), model=model)
    assert 1e3 * feeds.after_mm[1:] == pytest.approx([5.0, 5.0], rel=1e-4)
    points = proved(of(rapid(0, 0, 0), rapid(0, 9, 0)), model=model)
    assert 1e3 * points.after_mm == pytest.approx([5.0, 5.0], rel=1e-4)
    drilled = (rapid(0, 0, 5), line(0, 0, -4, flag=CYCLE), rapid(0, 0, 5, flag=CYCLE))
    for holes in ((), (hole(0, 3, r=5.0, z=-4.0),)):
        got = proved(of(*drilled, holes=holes), model=model)
        assert got.counts.tolist() == [Counts.RAPID, Counts.HOLE, Counts.RAPID]
        assert 1e3 * got.after_mm[1] == pytest.approx(5.0, rel=1e-4)


def pecked(*depths: float) -> tuple[Move, ...]:
    moves = [rapid(0, 0, 20), rapid(0, 0, 5, flag=CYCLE)]
    for depth in depths:
        moves += [line(0, 0, depth, flag=CYCLE), rapid(0, 0, 5, flag=CYCLE)]
    return tuple(moves)


def test_a_hole_counts_at_the_move_to_its_bottom() -> None:
    """Strokes above it have no figure; without partners all strokes are compared one by one."""
    holes = (hole(1, 6, r=5.0, z=-10.0),)
    mine, other = of(*pecked(-4.0, -10.0), holes=holes), of(*pecked(-5.0, -10.0), holes=holes)
    got = proved(mine, other, Known(aside))
    assert got.counts[1:].tolist() == [Counts.RAPID, Counts.HOLE, Counts.RAPID, Counts.HOLE, Counts.RAPID]
    size = np.where(got.judged, got.after_mm, np.nan)
    assert np.isnan(size).tolist() == [True, True, True, True, False, True]
    assert 1e3 * got.after_mm[4] == pytest.approx(2.0, rel=1e-4)
    alone = proved(replace(mine, holes=columns()), replace(other, holes=columns()), Known(aside))
    assert 1e3 * alone.after_mm[[2, 4]] == pytest.approx([1000.0, 2.0], rel=1e-3)
    assert 1e3 * alone.before_mm[[2, 4]] == pytest.approx([2.0, 2.0], rel=1e-3)


def test_a_stroke_counts_between_its_ends_too() -> None:
    """A whole wave of 10 um that is zero at both ends, with a partner and without."""
    for holes in ((hole(1, 4, r=5.0, z=-5.0),), ()):
        got = proved(of(*pecked(-5.0), holes=holes), model=wave(1, 2, 0.01, 10.0))
        assert got.after_mm[2] == pytest.approx(0.01, abs=1e-4)


def test_cuts_that_start_where_a_move_was_left_uncorrected_lean() -> None:
    moves = (
        rapid(0, 0, 0), line(9, 0, 0), line(9, 9, 0, flag=PASS), line(0, 9, 0), line(0, 0, 0),
        rapid(9, 0, 0), line(9, 9, 9), line(0, 0, 9),
    )  # fmt: skip
    got = proved(of(*moves), uncorrected=np.array([5]))
    assert np.flatnonzero(got.lean).tolist() == [3, 6]


@pytest.mark.parametrize(
    ("before", "after", "leans"),
    [
        (rapid(1, 0, 0), CUT, False), (rapid(1, 0, 0, flag=PASS), CUT, True),
        (rapid(1, 0, 0, flag=OF_MACHINE), CUT, True), (line(1, 0, 0, flag=CYCLE), CUT, True),
        (rapid(1, 0, 0, flag=CONTROL), CUT, False), (line(1, 0, 0, flag=WHOLE), CUT, False),
        (line(1, 0, 0, flag=PASS), rapid(5, 5, 5), False),
    ],
)  # fmt: skip
def test_what_leaves_the_tool_where_it_is_off(before: Move, after: Move, leans: bool) -> None:
    path = toolpath(before, after, CUT)
    assert uncorrected_starts(path, np.zeros(3, bool)).tolist() == [False, leans, False]
    # the first move has none before it, and the last one is before none
    assert uncorrected_starts(path, np.array([False, False, True])).tolist() == [False, leans, False]
    assert uncorrected_starts(path, np.array([False, True, False])).tolist() == [False, leans, True]


# -- what cannot be judged -------------------------------------------------------------------------------


def lost(axis_mm: Array) -> Array:
    """Not known from X 40 on."""
    return np.where(axis_mm[:, :1] > 40.0, NAN, [0.0, 0.002, 0.0])


def test_a_cut_whose_error_is_not_known_is_refused_with_its_line() -> None:
    path = of(rapid(0, 0, 0), line(9, 0, 0), rapid(50, 0, 0), line(50, 9, 0, line=7), line(50, 0, 0))
    with pytest.raises(ProgramError) as caught:
        proved(path, model=Known(lost))
    assert str(caught.value) == (
        "7: the deviation of this move cannot be computed: where the corrected program commands it, the "
        "error is not known; correct the nominal program again, or give start_mm in the job file"
    )
    assert (caught.value.line, caught.value.code) == (7, "OLP561")


def test_a_cut_that_is_left_uncorrected_there_is_unknown() -> None:
    moves = (rapid(0, 0, 0), line(9, 0, 0), rapid(50, 0, 0), line(50, 9, 0, flag=PASS), rapid(0, 0, 0))
    got = proved(of(*moves), model=Known(lost))
    expected = [Counts.RAPID, Counts.FEED, Counts.RAPID, Counts.UNKNOWN, Counts.RAPID]
    assert got.counts.tolist() == expected


def test_a_hole_or_a_point_there_is_refused() -> None:
    points = of(rapid(0, 0, 0), rapid(50, 0, 0))
    with pytest.raises(ProgramError, match="2: the deviation"):
        proved(points, model=Known(lost))
    holes = (hole(1, 6, r=5.0, z=-10.0),)
    mine, other = (
        of(*(replace(move, end=(x, *move.end[1:])) for move in pecked(-4.0, -10.0)), holes=holes)
        for x in (39.9999, 40.0001)
    )
    # its bottom is that of line 5
    with pytest.raises(ProgramError, match="5: the deviation"):
        proved(mine, other, Known(lost))


# -- what it is given ------------------------------------------------------------------------------------


def test_numbers_of_the_proof(monkeypatch: pytest.MonkeyPatch) -> None:
    """A move is found within 0.6 digits and a quarter of the tolerance; a tenth of that may be missed between
    samples."""
    given: dict[str, Any] = {}
    match, measure = module.match, module.measure

    def matched(*values: Any) -> Any:
        given["near"] = values[4]
        return match(*values)

    def measured(*values: Any, **words: Any) -> Deviation:
        given["bend"] = values[6]
        return measure(*values, **words)

    monkeypatch.setattr(module, "match", matched)
    monkeypatch.setattr(module, "measure", measured)
    got = proved(of(rapid(0, 0, 0), CUT), tolerance_mm=0.004, digit_mm=0.01)
    assert given == {"near": pytest.approx(0.007), "bend": pytest.approx(0.0004)}
    assert got.allowed_mm == pytest.approx(0.0127)


# -- its figures -----------------------------------------------------------------------------------------


def side_of(counts: np.ndarray, end: np.ndarray, whole: np.ndarray) -> tuple[Side, np.ndarray]:
    """From um at the ends, and of what counts."""
    waypoint, size = ((um / 1000).astype(np.float32) for um in (end, whole))
    return Side(np.zeros(len(size), np.float32), 0.0, module.figures(counts, waypoint, size)), size


def of_figures(*rows: tuple[Counts, float, float]) -> Proof:
    """From how it counts, um at the end, and um of what counts; corrected, and ten times that uncorrected."""
    counts = np.array([row[0] for row in rows], np.uint8)
    end, whole = (np.array([row[k] for row in rows], np.float32) for k in (1, 2))
    path = toolpath(*(line(k, 0, 0) for k in range(len(rows))))
    before, before_mm = side_of(counts, 10 * end, 10 * whole)
    after, after_mm = side_of(counts, end, whole)
    return Proof(
        path, path, np.arange(len(rows)), before, after, 1e-3, 1e-4, counts, before_mm, after_mm,
        np.zeros(len(rows), bool),
    )  # fmt: skip


FIGURES = of_figures(
    (Counts.FEED, 3.0, 6.0), (Counts.POINT, 4.0, 5.0), (Counts.HOLE, 9.0, 8.0), (Counts.LEFT, NAN, 7.0),
    (Counts.LEFT, 5.0, NAN), (Counts.RAPID, 50.0, NAN), (Counts.UNCORRECTED, 60.0, NAN),
    (Counts.UNKNOWN, 70.0, NAN),
)  # fmt: skip


@pytest.mark.parametrize(("side", "factor"), [("after", 1.0), ("before", 10.0)])
def test_a_summary_of_waypoints_and_of_what_lies_between(side: str, factor: float) -> None:
    """Waypoints of feeds, points and what is left; along feeds, holes and what is left."""
    got = getattr(FIGURES, side).summary
    assert got["waypoints"] == {
        "max_um": pytest.approx(5.0 * factor), "rms_um": pytest.approx(factor * math.sqrt(50 / 3))
    }  # fmt: skip
    assert got["between"] == {
        "max_um": pytest.approx(8.0 * factor), "rms_um": pytest.approx(factor * math.sqrt(149 / 3))
    }  # fmt: skip


def test_a_summary_of_nothing_is_zero() -> None:
    nothing = {"max_um": 0.0, "rms_um": 0.0}
    assert of_figures((Counts.RAPID, 5.0, NAN)).after.summary == {"waypoints": nothing, "between": nothing}
    assert of_figures().largest_mm == 0.0


@pytest.mark.parametrize(("um", "holds"), [(1.086, True), (1.088, False)])
def test_a_proof_holds_up_to_what_is_allowed(um: float, holds: bool) -> None:
    """1 um, and 0.87 of the last digit."""
    proof = of_figures((Counts.FEED, 0.0, um), (Counts.RAPID, 90.0, NAN))
    assert proof.allowed_mm == pytest.approx(1.087e-3)
    assert proof.largest_mm == pytest.approx(1e-3 * um)
    assert proof.size_mm(slice(None)) == pytest.approx([1e-3 * um, 0.0])
    assert proof.holds is holds


def test_the_owner_of_each_written_move() -> None:
    path = toolpath(*(line(k, 0, 0) for k in range(6)))
    proof = replace(FIGURES, written=path, groups=np.array([0, 3, 3, 5]))
    assert proof.owner().tolist() == [0, 1, 1, 1, 3, 3]


# -- how far waypoints were moved ------------------------------------------------------------------------


@pytest.mark.parametrize("plane", (0, 1, 2))
def test_corrections_of_moves_and_of_holes(plane: int) -> None:
    """Of a hole at the last of its moves: its position across it and its depth."""
    roll = [(0, 1, 2), (2, 0, 1), (1, 2, 0)][plane]
    nominal = (
        rapid(0, 0, 0), line(9, 0, 0), line(9, 9, 0), rapid(9, 9, 5, flag=CYCLE), line(9, 9, 0, flag=CYCLE),
        rapid(*NONE, flag=CONTROL), rapid(1, NAN, 1), rapid(3, 3, 3, flag=CONTROL),
    )  # fmt: skip
    written = (
        rapid(0, 0, 0), line(5, 0, 0), line(9.003, 0.004, 0), line(9, 9, -0.012),
        rapid(9.5, 9, 5, flag=CYCLE), line(9.5, 9, 0, flag=CYCLE), rapid(*NONE, flag=CONTROL),
        rapid(1.001, NAN, 1), rapid(8, 8, 8, flag=CONTROL),
    )  # fmt: skip
    mine = of(*nominal, holes=(hole(3, 5, plane=plane, r=5.0, z=-4.0, place=(9.0, 9.0)),))
    other = of(*written, holes=(hole(4, 6, plane=plane, r=5.0, z=-4.03, place=(9.01, 9.02)),))
    proof = replace(
        FIGURES, nominal=mine.toolpath, written=other.toolpath, groups=np.array([0, 2, 3, 4, 5, 6, 7, 8])
    )
    expected = np.zeros((8, 3))
    expected[1], expected[2], expected[6] = (0.003, 0.004, 0), (0, 0, -0.012), (0.001, 0, 0)
    expected[4, list(roll)] = 0.01, 0.02, -0.03
    assert corrections_mm(mine, other, proof) == pytest.approx(expected, abs=1e-9)
    assert largest_correction_mm(mine, other, proof) == pytest.approx(math.sqrt(0.0014))
    none = of()
    assert (
        largest_correction_mm(none, none, replace(proof, nominal=none.toolpath, groups=np.zeros(0, int)))
        == 0.0
    )
